"""How a scan is laid on its mannequin.

coarse_align: where it may stand; scale_search: how large it may be
robust_icp: its exact place, by the parts of the mannequin that show
"""
