"""U3M materials and an analyser's raw data: a made-up measurement whose law is known, and files that are wrong."""

from __future__ import annotations

import copy
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.io.fabrics import read_fabric

GF = 9.80665e-3  # [N], exactly
COUNT = 150


def stretch_test(stiffness: float, stiffening: float, longest: float, cycles: int = 2) -> dict[str, Any]:
    """T = a ε + b ε² up, 0.8 of it back, on a strip 5 cm wide; 2 % slack, and 0.4 gf where nothing pulls.

    The cycles before the last are half as stiff, so that the last is seen to be taken.
    """
    strain = np.concatenate([np.linspace(-0.02, 0.0, 20), np.linspace(longest / 300, longest, 300)])
    stretched = np.maximum(strain, 0.0)
    tension = stiffness * stretched + stiffening * stretched**2  # [N/m]
    branches = []
    for cycle in range(cycles):
        share = 1.0 if cycle == cycles - 1 else 0.5
        for along, factor in ((slice(None), share), (slice(None, None, -1), 0.8 * share)):
            samples = np.column_stack([8.1 * (1 + strain), tension * factor * 0.05 / GF + 0.4])[along]
            branches.append(samples.ravel().tolist())
    return {"freq": 55, "width": 5, "length": 8.1, "samplesTree": branches, "time": 1580129251}


def raw_data() -> dict[str, Any]:
    strips = {"L": (800.0, 40000.0, 0.05), "W": (300.0, 2000.0, 0.2), "B": (40.0, 1000.0, 0.3)}
    data: dict[str, Any] = {key: {"S2": stretch_test(*law), "D1": {"freq": 10}} for key, law in strips.items()}
    return {"schema": "1.1", "raw_data": data | {"M": 105.6, "T": {"freq": 10}}, "custom": {"somebody": "secret"}}


def material(fab: str = "physics/fab.json") -> dict[str, Any]:
    physics = {"thickness": 0.25, "weight": 104.0, "devices": {"fab": fab}, "composition": None}
    return {"schema": "1.1", "material": {"name": "lining", "front": None, "physics": physics}, "custom": None}


def write(path: Path, value: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))
    return path


def test_raw_data_give_curves_shear_and_loss(tmp_path: Path) -> None:
    fabric = read_fabric(write(tmp_path / "cupro.json", raw_data()))
    assert fabric.name == "cupro"
    assert fabric.areal_density == pytest.approx(0.1056, rel=1e-15)
    for curve, (a, b, longest) in ((fabric.curve_warp, (800, 40000, 0.05)), (fabric.curve_weft, (300, 2000, 0.2))):
        assert curve is not None
        strain = np.array(curve.strain)
        assert_allclose(strain[-1], longest, rtol=1e-12)  # rounding
        assert_allclose(curve.tension, a * strain + b * strain**2, rtol=1e-10, atol=1e-10)  # rounding
    # 800 ε + 40000 ε² = 98.0665 and 300 ε + 2000 ε² = 98.0665; the curve's chords are a little shorter
    assert_allclose(fabric.stretch_warp, 98.0665 / 0.04051398, rtol=3e-3)
    assert_allclose(fabric.stretch_weft, 98.0665 / 0.15879104, rtol=3e-3)
    # On the bias 40 ε + 1000 ε² = 4.903325 at ε = 0.05282393; G = T / (4 ε)
    assert_allclose(fabric.shear, 4.903325 / (4 * 0.05282393), rtol=5e-3)  # chords
    # Drawn to 1.3 of its length, the diagonal of a square is that of a rhombus sheared by γ, 1 + sin γ = 1.3²
    assert_allclose(np.degrees(fabric.shear_angle), 43.6302, rtol=1e-5)
    # A fifth is lost: 0.2 ½ LT of the tension, with ½ LT = (a/2 + b ε/3) / (a + b ε), mean of warp and weft
    halves = [(a / 2 + b * e / 3) / (a + b * e) for a, b, e in ((800, 40000, 0.05), (300, 2000, 0.2))]
    assert_allclose(fabric.stretch_hysteresis, 0.2 * sum(halves) / 2 * 4.903325, rtol=0.01)  # chords, 0.08 N/m of zero
    assert {"thickness", "poisson", "bending_warp", "friction"} <= set(fabric.assumed)
    assert not {"shear", "stretch_warp", "stretch_hysteresis"} & set(fabric.assumed)


def test_units_are_those_of_a_real_sample(tmp_path: Path) -> None:
    """The last sample of the published cupro's fourth cycle along the warp, and what others made of it."""
    data = raw_data()
    up = [8.12797, 0.0, 8.37979, 289.582, 8.449933052062989, 518.1729736328125]
    data["raw_data"]["L"]["S2"] |= {"length": 8.12797, "width": 5, "samplesTree": [up, [8.44, 500.0, 8.12, 0.0]]}
    curve = read_fabric(write(tmp_path / "a.json", data)).curve_warp
    assert curve is not None
    assert_allclose((curve.strain[-1], curve.tension[-1]), (0.039611, 101.6308), rtol=2e-5)  # as they rounded


def test_a_material_gives_its_name_mass_and_thickness_and_names_the_raw_data(tmp_path: Path) -> None:
    write(tmp_path / "physics" / "fab.json", raw_data())
    fabric = read_fabric(write(tmp_path / "lining.u3m", material()))
    alone = read_fabric(tmp_path / "physics" / "fab.json")
    assert (fabric.name, fabric.curve_warp) == ("lining", alone.curve_warp)
    assert_allclose((fabric.areal_density, fabric.thickness), (0.104, 0.25e-3), rtol=1e-14)  # its own, not M
    bare = read_fabric(write(tmp_path / "bare.u3m", material("null")))
    assert (bare.areal_density, bare.curve_warp) == (fabric.areal_density, None)
    assert "stretch_warp" in bare.assumed
    by_content = read_fabric(write(tmp_path / "bare.json", material("null")))
    assert by_content == dataclasses.replace(bare, source="U3M material, bare.json")


def test_a_fabric_file_in_json_stays_one(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"areal_density_gsm": 120,\n "thicknes_mm": 0.3}')
    with pytest.raises(VtoError) as caught:
        read_fabric(tmp_path / "a.json")
    assert caught.value.where.endswith("line 2")


def _set(*keys: str | int, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(data: Any) -> None:
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = to

    return change


S2 = ("raw_data", "L", "S2")


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (_set("raw_data", to=None), "raw_data is null; vendor data in `custom`"),
        (_set("schema", to="0.9"), "schema: input should be '1.1'"),
        (_set("raw_data", "M", to=None), "raw_data.M: input should be a valid number"),
        (_set("raw_data", "M", to=0.1), "raw_data.M: input should be greater than or equal to 1"),
        (_set("raw_data", "W", to={}), "raw_data.W.S2: field required"),
        (_set(*S2, "width", to=0), "raw_data.L.S2.width: input should be greater than 0"),
        (_set(*S2, "length", to="short"), "raw_data.L.S2.length: input should be a valid number"),
        (_set(*S2, "samplesTree", to=[[8.0, 0.0]] * 100), "list should have at most 64 items"),
        (_set(*S2, "samplesTree", 0, 3, to=float("nan")), "raw_data.L.S2.samplesTree.0.3: input should be"),
        (_set(*S2, "samplesTree", 0, 3, to=1e300), "raw_data.L.S2.samplesTree.0.3: input should be"),
        (_set(*S2, "samplesTree", 2, to=[8.0, 0.0, 8.1]), "a branch needs two or more pairs"),
        (_set(*S2, "samplesTree", to=[[8.0, 0.0, 8.2, 9.0]] * 2), "no loading branch followed by an unloading one"),
        (_set(*S2, "samplesTree", to=[[8.2, 5, 8.3, 3, 8.4, 0], [8.4, 0, 8.2, 0]]), "the tension never rises"),
    ],
)
def test_wrong_raw_data_are_refused(tmp_path: Path, change: Callable[[Any], None], problem: str) -> None:
    data = raw_data()
    change(data)
    path = write(tmp_path / "a.json", data)
    with pytest.raises(InputError) as caught:
        read_fabric(path)
    assert problem in caught.value.problem
    assert str(path) in caught.value.where


@pytest.mark.parametrize("fab", ["../fab.json", "/etc/fab.json", "a/../../fab.json", "link/fab.json", "fab\0.json"])
def test_a_material_cannot_name_a_file_outside_its_folder(tmp_path: Path, fab: str) -> None:
    write(tmp_path / "fab.json", raw_data())
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link").symlink_to(tmp_path)
    with pytest.raises(InputError, match="is not a path inside the material's folder"):
        read_fabric(write(tmp_path / "in" / "a.u3m", material(fab)))


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_fabric(tmp_path / "a.u3ma")
    assert caught.value.hint == "unpack it and give the .u3m file inside"
    look = material()
    look["material"]["physics"] = None
    with pytest.raises(InputError, match="describes only a look"):
        read_fabric(write(tmp_path / "look.u3m", look))
    weightless = material("null")
    weightless["material"]["physics"]["weight"] = None
    with pytest.raises(InputError, match="neither a weight nor a file of measurements"):
        read_fabric(write(tmp_path / "weightless.u3m", weightless))
    with pytest.raises(InputError, match="no such file"):
        read_fabric(write(tmp_path / "missing.u3m", material()))


def test_what_is_no_json_is_refused(tmp_path: Path) -> None:
    for name, text in {
        "a": '{"schema": "1.1",\n "raw_data"',
        "b": "[" * 100_000,
        "c": '"\ud800"',
        "d": "9" * 5000,
    }.items():
        path = tmp_path / f"{name}.json"
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        with pytest.raises(VtoError) as caught:
            read_fabric(path)
        assert str(path) in caught.value.where
        assert name != "a" or caught.value.where.endswith("line 2")


def test_damaged_raw_data_are_refused_or_sound(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    small = copy.deepcopy(raw_data())
    for key in "LWB":
        test = small["raw_data"][key]["S2"]
        test["samplesTree"] = [branch[:40] + branch[-80:] for branch in test["samplesTree"]]
    whole = np.frombuffer(json.dumps(small).encode(), np.uint8)
    typed = np.frombuffer(b'0123456789.,-:e[]{}" ', np.uint8)
    refused = 0
    for i in range(COUNT):
        damaged = whole.copy()
        at = rng.integers(0, len(whole), rng.integers(1, 6))
        damaged[at] = rng.integers(0, 256) if i % 4 == 0 else rng.choice(typed, len(at))
        end = rng.integers(1, len(whole)) if i % 8 == 1 else len(whole)
        path = tmp_path / "a.json"
        path.write_bytes(damaged[:end].tobytes())
        try:
            read_fabric(path)
        except VtoError:
            refused += 1
    assert COUNT // 8 < refused < COUNT
