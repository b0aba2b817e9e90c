"""Negative control: soft constraints without multipliers, which gives the wrong stiffness."""

from __future__ import annotations

from vto_pipeline.cloth.solvers.xpbd import Xpbd


class PbdSoft(Xpbd):
    """Position based dynamics with compliance in the denominator only: Δλ = -C / (∇C W ∇Cᵀ + α̃), without -α̃ λ.

    So are the soft links of many engines, and those of SolidCloth (Frâncu). It is implicit Euler for one sweep; with
    more sweeps the cloth grows stiffer, and its stiffness means nothing. It is kept so that there is a solver which a
    test of solvers must fail.
    """

    forgets = True
