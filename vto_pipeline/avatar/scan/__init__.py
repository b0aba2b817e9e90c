"""Registration of a body to a scan.

upright: unit, axes and orientation of a scan
initial_pose: where to begin
correspondence, registration: closest points; pose and shape by Gauss-Newton
tangential_slide, bust_points, displacement, misfit_correlation: the last millimetres
bind_pose: the result carried back, sound in both poses
clothed, body_under_clothes: the body inside a dressed scan
uncertainty/: how sure each measurement is
report: how well the result explains the scan, and whether it is a body
body_transfer: a body mesh of any topology carried along by its avatar
"""
