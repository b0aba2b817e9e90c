"""Where a draped cloth would end if it were minimised on, by a minimiser and contacts of its own.

The energy is the judge's, its derivatives are differences of it, and the steps are Levenberg and Marquardt's, by
SuperLU. What lies on the body keeps its place along it, as friction within its cone has it, and may lift off but come
no nearer; what other cloth may bear stays where it is.
"""

from itertools import combinations_with_replacement

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import splu

from vto_pipeline.cloth.judge.audit import JUST
from vto_pipeline.cloth.judge.gap import gaps_within
from vto_pipeline.cloth.judge.residual import ElasticEnergies, _angles
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.units import GRAVITY

_NUDGE = 2e-5  # m: what stands where it is not stable is pushed off it
_ENOUGH = 1e-5  # of a vertex's weight, rms
_LONGEST = 2e-3  # m a step
_MOST = 200  # steps
_ROUNDED = 1e-13  # J of energy, relative to what of it is moved: smaller changes are rounding


class Cloth:
    """A cloth that lies on a body, and what of it may move.

    Args:
        mesh: As draped [m].
        rest: Its rest shape.
        fabric: What it is made of.
        body: What it lies on, if anything.
        skin: Distance that vertices keep from the body [m], shape (V,).
        pinned: Vertices that are held.
    """

    def __init__(self, mesh, rest, fabric, body=None, skin=None, pinned=()):
        self.weave = ElasticEnergies(mesh, rest, fabric)
        self.start = mesh.vertices
        count = len(mesh.vertices)
        held, lying = np.zeros(count, bool), np.zeros(count, bool)
        held[list(pinned)] = True
        held |= self.weave.mass == 0.0
        ways = np.zeros((count, 3))
        if body is not None:
            near, gaps = gaps_within(mesh.vertices, rest.positions, mesh.faces, float(skin.min()) + JUST)
            held[mesh.faces[near[gaps < float(skin.min()) + JUST]]] = True
            nearest = SurfaceDistance(body).signed(mesh.vertices)
            lying = ~held & (nearest.distance < skin + JUST)
            ways = mesh.vertices - nearest.point
            ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
        self.free, self.lying = np.flatnonzero(~held & ~lying), np.flatnonzero(lying)
        self.held = np.flatnonzero(held)
        rows = [(3 * self.free[:, None] + np.arange(3)).ravel(), (3 * self.lying[:, None] + np.arange(3)).ravel()]
        columns = [np.arange(3 * len(self.free)), 3 * len(self.free) + np.repeat(np.arange(len(self.lying)), 3)]
        values = np.concatenate([np.ones(3 * len(self.free)), ways[self.lying].ravel()])
        shape = (3 * count, 3 * len(self.free) + len(self.lying))
        self.spread = csc_matrix((values, (np.concatenate(rows), np.concatenate(columns))), shape=shape)
        self.mass = self.spread.power(2).T @ np.repeat(self.weave.mass, 3)

    def at(self, q):
        """Positions [m] for what may move."""
        return self.start + (self.spread @ q).reshape(-1, 3)

    def energy(self, q):
        x = self.at(q)
        return self.weave.energy(x) + GRAVITY * float(self.weave.mass @ (x[:, 1] - self.start[:, 1]))

    def slope(self, q):
        pull = -self.weave.forces(self.at(q))
        pull[:, 1] += GRAVITY * self.weave.mass
        return self.spread.T @ pull.ravel()

    def stiffness(self, q):
        """Second derivatives, by differences of the energy of each triangle and of the angle of each hinge."""
        x, weave = self.at(q), self.weave
        turned, _ = self._differences(x, weave._faces, weave._membrane, 1.0)
        moments = weave.moments(x)
        bent, slopes = self._differences(x, weave.hinges, _angles, moments)
        rows = np.repeat(np.arange(len(moments)), slopes.shape[1])
        columns = (3 * weave.hinges[:, :, None] + np.arange(3)).reshape(len(moments), -1)
        slope = coo_matrix((slopes.ravel(), (rows, columns.ravel())), shape=(len(moments), x.size)).tocsr()
        whole = (turned + bent + slope.T @ weave.coupling @ slope).tocsc()
        return (self.spread.T @ whole @ self.spread).tocsc()

    def _differences(self, x, stencils, value, factor):
        """A factor times the second derivatives of a value of stencils, and the first ones, shape (N, 3 S)."""
        h, parts, corners = 1e3 * self.weave._step, [], x[stencils]
        ends = (3 * stencils[:, :, None] + np.arange(3)).reshape(len(stencils), -1)
        slopes = np.empty(ends.shape)

        def moved(*steps):
            there = corners.copy()
            for place, way in steps:
                there[:, place // 3, place % 3] += way * h
            return value(there)

        still = value(corners)
        for i, j in combinations_with_replacement(range(3 * stencils.shape[1]), 2):
            if i == j:
                ahead, behind = moved((i, 1)), moved((i, -1))
                slopes[:, i] = (ahead - behind) / (2.0 * h)
                parts.append((ends[:, i], ends[:, i], factor * (ahead - 2.0 * still + behind) / h**2))
                continue
            second = (moved((i, 1), (j, 1)) - moved((i, 1), (j, -1))) / (4.0 * h**2)
            second += (moved((i, -1), (j, -1)) - moved((i, -1), (j, 1))) / (4.0 * h**2)
            second = factor * second
            parts += [(ends[:, i], ends[:, j], second), (ends[:, j], ends[:, i], second)]
        rows, columns, values = (np.concatenate(each) for each in zip(*parts, strict=True))
        return coo_matrix((values, (rows, columns)), shape=(x.size, x.size)).tocsc(), slopes


def minimum(cloth, seed=0):
    """Positions of least energy near those of the cloth [m], and what is left of the forces there, rms in weights."""
    count = 3 * len(cloth.free)
    q = np.zeros(cloth.spread.shape[1])
    q[:count] = np.random.default_rng(seed).uniform(-_NUDGE, _NUDGE, count)
    energy, slope, stiffness = cloth.energy(q), cloth.slope(q), cloth.stiffness(q)
    held_back, fresh = 1.0, True  # 1/s², times the mass
    for _ in range(_MOST):
        bears = np.zeros(len(q), bool)
        bears[count:] = (q[count:] <= 0.0) & (slope[count:] > 0.0)
        (moving,) = np.nonzero(~bears)
        left = slope[moving] / (GRAVITY * cloth.mass[moving])
        if np.sqrt((left**2).sum() / max(len(cloth.free), 1)) < _ENOUGH:
            break
        part = stiffness[moving][:, moving]
        step = np.zeros(len(q))
        step[moving] = -splu((part + diags(held_back * cloth.mass[moving])).tocsc()).solve(slope[moving])
        step *= min(1.0, _LONGEST / np.abs(step).max())
        there = q + step
        there[count:] = np.maximum(there[count:], 0.0)
        step = there - q
        promised = -(slope @ step + 0.5 * step @ (stiffness @ step))
        ahead = cloth.energy(there)
        gained = energy - ahead
        rounded = _ROUNDED * GRAVITY * float(cloth.mass.sum())
        good = slope @ step < 0.0 and (gained > 0.1 * max(promised, 0.0) - rounded)
        if good:
            q, energy, slope = there, ahead, cloth.slope(there)
            held_back = held_back / 4.0 if gained > 0.5 * promised - rounded else 2.0 * held_back
            refresh = gained < 0.8 * promised - rounded
        else:
            held_back, refresh = 8.0 * max(held_back, 1.0), not fresh
        fresh = refresh
        if refresh:
            stiffness = cloth.stiffness(q)
    return cloth.at(q), float(np.sqrt((left**2).sum() / max(len(cloth.free), 1)))
