"""What must hold exactly: closed forms that no step size and no tolerance may blur."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline.bench.cloth.closed_forms import ROOTS, growth_and_frequency, implicit_dumbbell
from vto_pipeline.bench.cloth.integrators import KEEP_SPIN, dominant_root, dumbbell, oscillator, spin
from vto_pipeline.cloth.collision.contacts import ContactSpan, empty_contacts
from vto_pipeline.cloth.collision.shapes.colliders import Plane
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.solvers.xpbd import Xpbd
from vto_pipeline.model.garment import RestShape

EXACT = 1e-10  # relative to motions of about one metre
IMPLICIT_EULER = ["backward_euler", "backward_euler_newton", "imex", "ncg"]  # on a linear system they are one method
CONVERGED = ["backward_euler_newton", "ncg"]
ITERATED = {"ncg": 1e-7}  # where hundreds of iterations end, rounding is some 1e-13 m of a step

# The spring of Macklin, Müller & Chentanez 2016: m = 1, α = 1e-3, rest length 1, start at 1.5. h -> step -> (x, v),
# from the recursion of implicit Euler.
XPBD_PAPER = {
    1 / 60: {
        1: (1.391304347826, -6.521739130435),
        5: (0.795673412682, -5.625399392170),
        60: (0.999783642210, 0.007460886818),
    },
    1 / 240: {1: (1.491467576792, -2.047781569966), 60: (0.998080858876, -9.434242623171)},
    1 / 1000: {1: (1.499500499500, -0.499500499501), 60: (0.844630445252, -14.536453951639)},
}


def method_of(name, model, **settings):
    """The constraint solver or the integrator of this name, solved as far as rounding goes."""
    return Xpbd(model, **settings) if name == "xpbd" else INTEGRATORS[name](model, tolerance=1e-13, **settings)


def spring_of_the_paper(beta=0.0):
    data = springs([[0, 1]], np.array([[0.0, 0, 0], [1, 0, 0]]), 1e-3, damping=beta)
    return model_of((data,), np.ones(2), pinned=[0], gravity=(0, 0, 0))


def stretched():
    return at_rest(np.array([[0.0, 0, 0], [1.5, 0, 0]]))


def soft_constraint(x, v, h, compliance, iterations):
    """The negative control: compliance scales the correction, without -α̃λ (SolidCloth's soft constraint)."""
    new = x + h * v
    for _ in range(iterations):
        new -= (new - 1.0) / (1.0 + compliance / h**2)
    return new, (new - x) / h


@pytest.mark.parametrize("sweeps", [1, 7])
@pytest.mark.parametrize("h", XPBD_PAPER)
def test_xpbd_on_one_spring_is_the_table(h, sweeps):
    for step, (x, v) in XPBD_PAPER[h].items():
        end = Xpbd(spring_of_the_paper(), sweeps=sweeps).advance(stretched(), empty_contacts(2), h, step)
        assert_allclose(end.positions[1], [x, 0, 0], rtol=0, atol=1e-11)  # digits of the table
        assert_allclose(end.velocities[1], [v, 0, 0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["xpbd", "backward_euler", *CONVERGED])
@pytest.mark.parametrize("beta", [0.0, 2e-3, 0.05])
@pytest.mark.parametrize("h", [1 / 60, 1 / 240, 1 / 1000])
def test_one_spring_is_implicit_euler_with_and_without_damper(h, beta, name):
    """γ = c/(k h), c = β k, against the recursion (1 + h c/m + h² k/m) v₁ = v - h k/m (x - 1)."""
    k = 1e3
    end = method_of(name, spring_of_the_paper(beta)).advance(stretched(), empty_contacts(2), h, 50)
    x, v = 1.5, 0.0
    for _ in range(50):
        v = (v - h * k * (x - 1.0)) / (1.0 + h * beta * k + h * h * k)
        x += h * v
    assert_allclose(end.positions, [[0, 0, 0], [x, 0, 0]], rtol=0, atol=EXACT)
    assert_allclose(end.velocities, [[0, 0, 0], [v, 0, 0]], rtol=0, atol=EXACT * np.sqrt(k))


def test_without_the_multiplier_term_the_identity_fails():
    h, alpha = 1 / 60, 1e-3
    exact = method_of("backward_euler_newton", spring_of_the_paper()).advance(stretched(), empty_contacts(2), h, 5)
    for iterations, low, high in ((1, 0.0, 1e-12), (2, 1e-2, 1.0), (10, 1e-2, 1.0)):
        x, v = 1.5, 0.0
        for _ in range(5):
            x, v = soft_constraint(x, v, h, alpha, iterations)
        assert low <= abs(x - exact.positions[1, 0]) < high
    right = Xpbd(spring_of_the_paper(), sweeps=10).advance(stretched(), empty_contacts(2), h, 5)
    assert_allclose(right.positions, exact.positions, rtol=0, atol=EXACT)


@pytest.mark.parametrize("h_omega", [0.05, 0.2, 0.5, 1.0, 1.9, 2.5, 5.0])
@pytest.mark.parametrize("name", [*INTEGRATORS, "xpbd"])
def test_growth_and_frequency_of_an_oscillator(name, h_omega):
    omega = 10.0
    h = h_omega / omega
    method = method_of(name, oscillator(omega, mass=0.7))
    state = ClothState(np.array([[0, 0, 0], [0.6, 0, 0.8]]), np.zeros((2, 3)))
    xs = []
    for _ in range(44):  # after forty steps the second root of a two-step method is gone
        xs.append(state.positions[1, 0])
        state = method.advance(state, empty_contacts(2), h, 1)
    root = dominant_root(np.array(xs[-4:]))
    growth, frequency = growth_and_frequency("backward_euler" if name == "xpbd" else name, h_omega)
    assert_allclose(abs(root), growth, rtol=EXACT)
    assert_allclose(abs(np.angle(root)) / h_omega, frequency, rtol=0, atol=EXACT)
    assert_allclose(state.positions[1], [0.6 * state.positions[1, 2] / 0.8, 0, state.positions[1, 2]], rtol=EXACT)


def damped_root(name, h, omega, rate):
    """The dominant root for ẍ = -ω²x - rate ẋ: that of y' = λy, or where x and v are treated apart, from their map."""
    if name in ("symplectic_euler", "leapfrog"):
        return max(np.roots([1.0, rate * h + (h * omega) ** 2 - 2.0, 1.0 - rate * h]), key=abs)
    if name == "imex":
        return max(np.roots([1.0 + (h * omega) ** 2, rate * h - 2.0, 1.0 - rate * h]), key=abs)
    return ROOTS[name](h * complex(-rate / 2, np.sqrt(omega**2 - rate**2 / 4)))


@pytest.mark.parametrize("term", ["mass", "stiffness", "both"])
@pytest.mark.parametrize("name", sorted(set(INTEGRATORS) - {"verlet"}))  # whose damping is a third variable
def test_decay_by_rayleigh_damping(name, term):
    """Both terms on one oscillator, ẍ = -ω²x - (α + β ω²) ẋ, in the closed form of each method."""
    omega, h = 10.0, 0.03
    alpha, beta = {"mass": (1.5, 0.0), "stiffness": (0.0, 0.015), "both": (0.7, 0.008)}[term]
    model = oscillator(omega, mass=0.7, damping=beta)
    start = ClothState(np.array([[0, 0, 0], [0.6, 0, 0.8]]), np.zeros((2, 3)))
    steps = range(40, 44)
    ends = [method_of(name, model, damping=alpha).advance(start, empty_contacts(2), h, count) for count in steps]
    root = dominant_root(np.array([end.positions[1, 0] for end in ends]))
    exact = damped_root(name, h, omega, alpha + beta * omega**2)
    assert abs(ROOTS[name](1j * h * omega)) - abs(exact) > 0.01  # it does something
    assert_allclose([root.real, abs(root.imag)], [exact.real, abs(exact.imag)], rtol=0, atol=EXACT)


def test_every_integrator_has_its_closed_form():
    assert set(ROOTS) == set(INTEGRATORS)


@pytest.mark.parametrize(
    ("h_omega", "explicit", "implicit", "verlet_ratio", "midpoint_ratio", "implicit_ratio"),
    [
        (0.1, 1.00498756, 0.99503719, 1.00041714, 0.99916791, 0.99668652),
        (0.5, 1.11803399, 0.89442719, 1.01072102, 0.97991465, 0.92729522),
        (1.9, 2.14709106, 0.46574643, 1.31919568, 0.79975027, 0.57174653),
    ],
)
def test_closed_forms_are_those_of_the_table(h_omega, explicit, implicit, verlet_ratio, midpoint_ratio, implicit_ratio):
    found = {name: growth_and_frequency(name, h_omega) for name in ROOTS}
    digits = {"rtol": 0, "atol": 1e-8}  # of the table
    assert_allclose(found["explicit_euler"], (explicit, implicit_ratio), **digits)
    assert_allclose(found["backward_euler"], (implicit, implicit_ratio), **digits)
    assert_allclose(found["verlet"], (1.0, verlet_ratio), **digits)
    assert_allclose(found["implicit_midpoint"], (1.0, midpoint_ratio), **digits)
    # the rest by series in θ = hω (Hairer & Wanner 1996): |R|² = 1 + θ⁴/4, 1 - θ⁶/72 + θ⁸/576
    assert_allclose(found["rk2"][0] ** 2, 1 + h_omega**4 / 4, rtol=1e-14)
    assert_allclose(found["rk4"][0] ** 2, 1 - h_omega**6 / 72 + h_omega**8 / 576, rtol=1e-14)
    for name, coefficients in (
        ("bdf2", [1.5 - 1j * h_omega, -2, 0.5]),
        ("predictor_corrector", [1, 0.75 * h_omega**2 - 1 - 1j * h_omega, -(h_omega**2) / 4]),
    ):
        assert_allclose(found[name][0], np.abs(np.roots(coefficients)).max(), rtol=1e-13)


@pytest.mark.parametrize(("h", "left"), [(1 / 60, 0.26500976), (1 / 240, 0.48202263), (1 / 1000, 0.74719069)])
@pytest.mark.parametrize("name", [*CONVERGED, "xpbd"])
def test_spin_decay_of_a_dumbbell(name, h, left):
    model, start = dumbbell()
    method = method_of(name, model)
    steps = round(10 / h)
    end = method.advance(start, empty_contacts(2), h, steps)
    length = 1.0 / (1.0 - (2 * np.pi) ** 2 / 2e4)  # where the spring bears the turning masses
    r, u = implicit_dumbbell((length, 0.0), (0.0, 2 * np.pi * length), 1.0, 2e4, h, steps)
    exact = max(ITERATED.get(name, EXACT), 1e-13 * steps)  # rounding adds up
    assert_allclose(np.diff(end.positions, axis=0)[0], [*r, 0], rtol=0, atol=exact)
    assert_allclose(np.diff(end.velocities, axis=0)[0], [*u, 0], rtol=0, atol=100 * exact)  # a position over h
    assert_allclose(spin(model, end)[2] / spin(model, start)[2], left, rtol=0, atol=1e-8)  # digits of the reference


def test_spin_decay_of_a_rigid_dumbbell():
    """One PBD projection a step: Δ₁ = atan(sin Δ / (2 - cos Δ)) for the angle of a step."""
    h, steps = 1 / 60, 600
    model, _ = dumbbell(stiffness=np.inf)
    angle = np.arctan(2 * np.pi * h)  # the first step leaves the circle along its tangent
    start = np.array([[-0.5, 0, 0], [0.5, 0, 0]])
    state = ClothState(start, 2 * np.pi * np.cross([0, 0, 1.0], start))
    end = Xpbd(model).advance(state, empty_contacts(2), h, steps)
    for _ in range(steps - 1):
        angle = np.arctan2(np.sin(angle), 2 - np.cos(angle))
    turning = np.cross(np.diff(end.positions, axis=0)[0], np.diff(end.velocities, axis=0)[0])[2]
    assert_allclose(turning, np.sin(angle) / h, rtol=EXACT)
    assert_allclose(angle / h / (2 * np.pi), 0.26568, rtol=0, atol=1e-3)  # the reference starts with a turned step


@pytest.mark.parametrize("name", INTEGRATORS)
def test_angular_momentum(name):
    """Turning and pulsing: kept exactly, lost, or drifting by the method's order."""
    h, steps = 1 / 480, 480
    model, start = dumbbell()
    start = ClothState(1.1 * start.positions, start.velocities)
    end = method_of(name, model).advance(start, empty_contacts(2), h, steps)
    change = spin(model, end)[2] / spin(model, start)[2] - 1.0
    if name in KEEP_SPIN:
        assert abs(change) < EXACT
    elif name in IMPLICIT_EULER:
        assert -0.3 < change < -0.03  # a step loses the share (h ω)², 480 some 8 per cent, more while it pulses
    else:
        assert abs(change) > 1e-7


@pytest.mark.parametrize("name", [*INTEGRATORS, "xpbd"])
def test_linear_momentum_is_conserved_to_rounding(name):
    mesh = sheet(6, 5, 0.3, 0.25)
    cloth = fabric(stretch=300.0, shear=80.0, poisson=0.2, bending=1e-3)
    model = build_cloth(mesh, RestShape(mesh.vertices), cloth, gravity=(0, 0, 0))
    rng = np.random.default_rng(5)
    start = ClothState(mesh.vertices + rng.normal(0, 5e-3, (30, 3)), rng.normal((0.5, -0.2, 0.7), 1, (30, 3)))
    method = method_of(name, model)
    end = method.advance(start, empty_contacts(30), 1e-4, 50)
    before, after = model.mass @ start.velocities, model.mass @ end.velocities
    scale = model.mass @ np.abs(start.velocities)
    exchanged = model.mass @ np.abs(end.velocities - start.velocities)
    assert exchanged.min() > 0.1 * scale.max()
    assert_allclose(after, before, rtol=0, atol=1e-11 * scale.max())  # rounding of positions, 1e-16 m, over h


def chain(links, *, load=0.4, length=1.0, stiffness_length=30.0):
    """A hanging chain of equal springs, half masses at its ends, and its exact shape under its own weight."""
    g = 9.81
    mass = np.full(links + 1, load / links)
    mass[[0, -1]] /= 2
    at = np.linspace(0, length, links + 1)
    points = np.column_stack([0 * at, -at, 0 * at])
    pairs = np.column_stack([np.arange(links), np.arange(1, links + 1)])
    stiffness = stiffness_length * links / length
    model = model_of((springs(pairs, points, 1.0 / stiffness),), mass, pinned=[0], gravity=(0, -g, 0))
    carried = load - (np.arange(links) + 0.5) * load / links
    y = -np.concatenate([[0], np.cumsum(length / links + carried * g / stiffness)])
    return model, points, np.column_stack([0 * at, y, 0 * at]), load * g * length / (2 * stiffness_length)


@pytest.mark.parametrize("name", [*INTEGRATORS, "xpbd"])
def test_hanging_chain(name):
    model, points, hanging, longer = chain(5)
    assert_allclose(-hanging[-1, 1] - 1.0, longer, rtol=1e-14)  # ρ g L²/(2Y), whatever the number of links
    method = method_of(name, model, **({"sweeps": 200} if name == "xpbd" else {}))
    stays = method.advance(at_rest(hanging), empty_contacts(6), 1e-3, 20)
    assert_allclose(stays.positions, hanging, rtol=0, atol=EXACT)
    if name == "xpbd":
        settles = Xpbd(model, sweeps=200).advance(at_rest(points), empty_contacts(6), 0.05, 300)
    elif name in (*IMPLICIT_EULER, "bdf2"):
        settles = method_of(name, model, damping=12.0).advance(at_rest(points), empty_contacts(6), 0.05, 150)
    else:  # explicit Euler needs h < α/ω²
        settles = method_of(name, model, damping=30.0).advance(at_rest(points), empty_contacts(6), 2e-3, 3000)
    assert_allclose(settles.positions, hanging, rtol=0, atol=EXACT)


def test_conjugate_gradients_reach_the_minimum_where_steepest_descent_cannot():
    """On a linear chain of condition 1e4: 500 steps of steepest descent leave 50 mm."""
    model, points, _, _ = chain(60)
    one, other = (method_of(name, model).advance(at_rest(points), empty_contacts(61), 1.0, 1) for name in CONVERGED)
    assert np.ptp(one.positions[:, 1] - points[:, 1]) > 0.01
    assert_allclose(other.positions, one.positions, rtol=0, atol=1e-6)  # where its steps end


@pytest.mark.parametrize("name", ["backward_euler_newton", "bdf2", "ncg"])
def test_hanging_strip(name):
    """Membrane triangles with the mass of each row spread as its stress is: the same ΔL = ρ g L²/(2Y)."""
    rows, length, width, density, stiffness = 9, 1.0, 0.2, 0.3, 40.0
    mesh = sheet(3, rows, width, length)
    cloth = fabric(stretch=stiffness, shear=10.0, density=density)
    made = build_cloth(mesh, RestShape(mesh.vertices), cloth)
    mass = (
        np.outer(np.r_[0.5, np.ones(rows - 2), 0.5], [0.25, 0.5, 0.25]).ravel() * density * width * length / (rows - 1)
    )
    model = model_of(made.constraints, mass, pinned=[0, 1, 2], gravity=(0, -9.81, 0))
    exact = mesh.vertices.copy()
    s = -mesh.vertices[:, 1]
    exact[:, 1] = -s - density * 9.81 / stiffness * (length * s - s**2 / 2)
    end = method_of(name, model, damping=5.0).advance(at_rest(mesh.vertices), empty_contacts(3 * rows), 0.5, 80)
    close = 10 * EXACT  # the step at which the iterations end
    assert_allclose(end.positions, exact, rtol=0, atol=close)
    assert_allclose(-end.positions[-1, 1] - length, density * 9.81 * length**2 / (2 * stiffness), rtol=0, atol=close)


@pytest.mark.parametrize("name", ["symplectic_euler", *IMPLICIT_EULER, "xpbd"])
def test_slide_down_an_incline(name):
    """From rest x_n = a h² n (n + 1)/2 with a = g (sin θ - μ cos θ); below μ = tan θ only."""
    angle, h, steps = np.radians(30.0), 0.01, 50
    along, normal = np.array([np.cos(angle), -np.sin(angle), 0.0]), np.array([np.sin(angle), np.cos(angle), 0.0])
    model = model_of((), np.array([0.2]), gravity=(0, -9.81, 0))
    for mu in (0.0, 0.3, 0.6):
        plane = Plane((0, 0, 0), tuple(normal), mu)
        method = method_of(name, model)
        state = at_rest(np.zeros((1, 3)))
        for _ in range(steps):
            span = ContactSpan(state.time, state.time + h, 0.5, np.zeros(1), 0.5)
            state = method.advance(state, plane.contacts(state.positions, span), h, 1)
        a = max(0.0, 9.81 * (np.sin(angle) - mu * np.cos(angle)))
        slid = a * h * h * steps * (steps + 1) / 2
        assert (slid > 0.1) == (mu < 0.5)
        assert_allclose(state.positions[0], slid * along, rtol=0, atol=EXACT)
        assert_allclose(state.velocities[0], a * h * steps * along, rtol=0, atol=EXACT)
