"""The last steps to rest: growing steps with the exact stiffness, while no cloth is about to buckle."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.dynamics.stepper import Stepper

LOOK = 0.1  # s of cloth time between looks
LONGEST = 1.0  # s: inertia holds nothing back in a step of that length that cloth still waits for
_LONGER = 4.0  # times, the next step while the system is positive definite, at most
_FORGOTTEN = 2.0  # times, after each step that was: the length from which on it is not changes with the cloth
_ASIDE = 10.0  # times the left-over force at its begin, at first: what is soft comes first, at the expense of the stiff
_FALLS = 0.5  # times that after each look
_SLIGHT = 0.1  # of the left-over force that is enough: less is no sign of going astray
_SHORTER = 64.0  # times shorter than usual, at most, where cloth is about to buckle
_STANDS = 1e-5  # m: a move from look to look that is none, rms over vertices
_PAUSE = 4  # looks in usual steps where the shortest, or the longest, were of no use; twice as many after each time
_TORN = 100.0  # weights left over: what comes to that in a few short steps has snapped into a place to be torn out of
_FEW = 3  # of these steps to a look: it is the way that matters there, not the time it takes


class StableNewtonSteps:
    """Chooses the steps of a cloth that comes to rest.

    With inertia gone a step with the exact stiffness is one of Newton's method (pseudo-transient continuation; Kelley &
    Keyes 1998), which may also lead away, where contacts or wrinkles are other at its end than at its begin. So what is
    left of the force has to fall from look to look, if not from the first one on (a watchdog; Chamberlain et al. 1982);
    a step that leaves more is not taken, unless it is as short as usual: that is no guess, but cloth on its way. Forces
    grow so where it falls out of a place it was not stable in, and stays at, all but still, with the usual stiffness.

    Where the system is not positive definite in steps as long as usual, cloth is about to buckle, and in the usual
    ones, which are accelerated, it mostly does. Where these lead nowhere, the exact ones are shorter until it is. For
    the usual stiffness leaves out what makes cloth buckle: with it, a fold may even come to stand on its saddle. The
    nearer a step is to the length from which on there is no definite system, the farther it goes along the mode that
    buckles. So that length is bracketed: each try is the geometric mean of what did and did not, and what did is kept
    meanwhile. A step that fails is not taken, and costs little.
    Where it is not in the shortest ones either, as in cloth that buckles within an edge, time would stand still: so the
    usual stiffness goes on for a while. So it does where short steps snap cloth into a place that it is torn out of.

    Thread hardly stretches: what has moved by a micrometre may pull with many times its weight, and is no farther from
    rest for that. So where cloth all but stands still, steps grow whatever the force. Where it fails to fall then too,
    they do again after a while.

    Args:
        stepper: The cloth among its colliders, prepared; its steps are changed.
        enough: Left-over force, as a share of weight, at which cloth counts as in balance.

    Attributes:
        indefinite_step: The shortest in which the system was not positive definite [s]; may be set, infinite for none.
    """

    def __init__(self, stepper: Stepper, enough: float) -> None:
        self._stepper = stepper
        self._usual = stepper.substeps
        self.indefinite_step = np.inf
        self._enough = enough
        self._most = self._before = np.inf
        self._tried = False
        self._did, self._failed = np.inf, np.inf  # s: lengths of steps with and without a definite system, of late
        self._wait, self._pause = 0, _PAUSE

    @property
    def span(self) -> float:
        """Cloth time until the next look [s]."""
        stepper = self._stepper
        if stepper.can_use_exact_stiffness and stepper.substeps > self._usual:
            return _FEW * stepper.step
        return max(LOOK, stepper.step)

    @property
    def took_full_step(self) -> bool:
        """Whether the last step went all the way there was to go, of a cloth that is stable there."""
        return self._stepper.was_positive_definite and self._stepper.step >= LONGEST

    def diverged(self, residual: float, moved: float) -> bool:
        """Return whether the last steps are to be taken back, and others chosen: they led away from rest.

        Long ones may, and short ones in which cloth that buckles has snapped into a place that it is torn out of.

        Args:
            residual: Left-over force after it.
            moved: How far it went, rms over vertices [m].
        """
        stable, steps = self._stepper.was_positive_definite, self._stepper.substeps
        strays = stable and steps < self._usual and residual > self._most and not self._stands(moved)
        tears = not stable and steps > self._usual and residual > max(_TORN, _ASIDE * self._before)
        if strays:
            self._shorten(self._usual)
        elif tears:
            self._give_up()
        else:
            self._before = residual
        return strays or tears

    def choose(self, near: bool, stuck: bool, residual: float, moved: float) -> None:
        """Choose the next steps: with the exact stiffness, longer while that will do, else the usual ones.

        Args:
            near: Whether the exact stiffness is worth trying.
            stuck: Whether the usual steps have long led hardly anywhere: then it is, and in short steps, too.
            residual: Left-over force now.
            moved: How far the last look's steps went, rms over vertices [m].
        """
        self._wait = max(self._wait - 1, 0)
        stepper, stands = self._stepper, self._stands(moved)
        if self.took_full_step and residual >= self._enough and stands:
            self._pause_longer()
            stepper.substeps = self._usual
            return
        if stepper.was_positive_definite and residual > self._most and not stands:
            self._most = _ASIDE * residual
        elif stepper.was_positive_definite:
            self._most = max(_FALLS * self._most, _SLIGHT * self._enough)
            if residual < self._enough or stands or stepper.substeps > self._usual:
                self._lengthen()
        elif stepper.substeps < self._usual:
            self.indefinite_step = min(self.indefinite_step, stepper.step)
            self._shorten(self._usual)
        else:
            self._most = _ASIDE * max(residual, _SLIGHT * self._enough)
            if self._tried and stuck and stepper.substeps < _SHORTER * self._usual:
                self._shorten(_SHORTER * self._usual)
            elif self._tried:  # what is about to buckle does so sooner in usual steps, or there is no end to that way
                self._give_up()
            elif (near or stuck) and (self._wait == 0 or residual < self._enough):
                self._tried = True
                stepper.use_exact_stiffness(True)

    def _stands(self, moved: float) -> bool:
        """Return whether that is no move, and long steps have not just shown that force is left all the same."""
        return moved <= _STANDS and self._wait == 0

    def _pause_longer(self) -> None:
        self._wait, self._pause = self._pause, 2 * self._pause

    def _give_up(self) -> None:
        """Go on with the usual steps for a while, longer each time."""
        self._pause_longer()
        self._tried = False
        self.end()

    def _lengthen(self) -> None:
        step = self._stepper.step
        self._did = step
        self._failed = self._failed * _FORGOTTEN if self._failed > step else np.inf
        self._stepper.substeps = FRAME / min(_LONGER * step, np.sqrt(step * self._failed), LONGEST)

    def _shorten(self, most: float) -> None:
        """Let steps be as long as those that last did, or some times shorter, with `most` steps per 1/60 s at most."""
        step = self._stepper.step
        self._failed = step
        shorter = step / _LONGER
        self._stepper.substeps = min(FRAME / (max(shorter, self._did) if self._did < step else shorter), most)

    def end(self) -> None:
        """Go back to the usual steps."""
        self._stepper.substeps = self._usual
        self._stepper.use_exact_stiffness(False)
