"""Sheets of KES-FB and FAST: conversions against hand-computed figures, two ways to write them, bad ones refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.numerics.mechanics.monotone_curve import curve_at, monotone_curve

KES = """\
instrument: KES-FB
name: wool tropical
source: our laboratory
W: 16.29
T0: 0.407
LT: {warp: 0.62, weft: 0.58}
WT: {warp: 9.3, weft: 14.5}
RT: {warp: 70, weft: 64}
EMT: {warp: 6.0, weft: 10.0}
G: {warp: 0.6, weft: 0.5}
2HG: {warp: 0.4, weft: 0.6}
2HG5: 1.2
B: {warp: 0.071, weft: 0.063}
2HB: 0.033
MIU: {warp: 0.18, weft: 0.20}
MMD: 0.02
SMD: 4.1
LC: 0.35
WC: 0.12
RC: 55
TM: 0.30
"""

KES_CSV = """\
instrument, KES-FB
name, wool tropical
source, our laboratory
parameter, warp, weft
W, 16.29
T0, 0.407
LT, 0.62, 0.58
WT, 9.3, 14.5
RT, 70, 64
EMT, 6.0, 10.0
G, 0.6, 0.5
2HG, 0.4, 0.6
B, 0.071, 0.063
2HB, 0.033,
MIU, 0.18, 0.20
"""

FAST = """\
instrument: FAST
name: suiting
W: 185
T2: 0.52
ST: 0.12
C: {warp: 19.0, weft: 17.0}
E5: {warp: 0.3, weft: 0.9}
E20: {warp: 0.9, weft: 2.1}
E100: {warp: 2.6, weft: 5.0}
EB5: 2.5
RS: {warp: -0.4, weft: 1.2}
"""

COUNT = 150


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_kes_sheet_in_si(tmp_path: Path) -> None:
    fabric = read_fabric(write(tmp_path, "wool.yaml", KES))
    expected = {
        "areal_density": 0.1629,  # 16.29 mg/cm² · 10 g/m²
        "thickness": 0.407e-3,
        "shear": 0.55 * 56.18796564,  # gf/(cm·deg) = 0.980665 N/m · 180/π, mean of both
        "shear_hysteresis": 0.5 * 0.980665,
        "bending_warp": 0.071 * 9.80665e-5,  # gf·cm²/cm
        "bending_weft": 0.063 * 9.80665e-5,
        "bending_hysteresis": 0.033 * 9.80665e-3,
        "friction": 0.19,
        "stretch_hysteresis": 4.903325 * (0.62 / 2 * 0.30 + 0.58 / 2 * 0.36) / 2,
    }
    for name, value in expected.items():
        assert_allclose(getattr(fabric, name), value, rtol=1e-9, err_msg=name)  # the factors above have ten figures
    assert (fabric.name, fabric.source) == ("wool tropical", "our laboratory")
    assert fabric.assumed == ("poisson", "damping")
    assert fabric.curve_warp is not None
    # The curve ends at 500 gf/cm and EMT, with the sheet's energy LT ½ Fmax EMT, which is WT to the sheet's figures.
    assert_allclose((fabric.curve_warp.strain[-1], fabric.curve_warp.tension[-1]), (0.06, 490.3325), rtol=1e-12)
    cubic = monotone_curve(fabric.curve_warp.strain, fabric.curve_warp.tension)
    assert_allclose(curve_at(cubic, 0.06)[0], 9.3 * 0.980665, rtol=0.01)  # LT has two figures
    # The linear stiffness is its secant to 100 gf/cm: ε = EMT (1/5)^(1/p), p = 2 / LT - 1, by chords of 17 knots.
    reached = 0.06 * 0.2 ** (1 / (2 / 0.62 - 1))
    assert_allclose(fabric.stretch_warp, 98.0665 / reached, rtol=5e-3)
    assert any("98.1 N/m" in line for line in fabric.derived)


def test_both_ways_of_writing_and_a_continental_csv_are_the_same_fabric(tmp_path: Path) -> None:
    yaml = read_fabric(write(tmp_path, "wool.yaml", KES))
    assert read_fabric(write(tmp_path, "wool.csv", KES_CSV)) == yaml
    body = (
        KES_CSV.replace(", ", ";").replace(",\n", ";\n").replace(".", ",").replace("our laboratory", '"our laboratory"')
    )
    assert read_fabric(write(tmp_path, "semicolons.csv", "\ufeff" + body)) == yaml  # marked, as a spreadsheet does
    keys = {"instrument": "KES-FB", "W": 16.29}
    assert read_fabric(keys).areal_density == pytest.approx(0.1629, rel=1e-15)


@pytest.mark.parametrize(
    ("written", "value", "field", "si"),
    [
        ("B [cN·cm²/cm]", 0.356, "bending_warp", 3.56e-5),
        ("B [cN.cm2/cm]", 0.356, "bending_warp", 3.56e-5),
        ("B [µN·m]", 35.6, "bending_warp", 3.56e-5),
        ("2HB[cN·cm/cm]", 0.1, "bending_hysteresis", 1e-3),
        ("2HB [mN]", 1.0, "bending_hysteresis", 1e-3),
        ("G [cN/(cm·deg)]", 1.0, "shear", 180 / np.pi),
        ("G [cN/(cm*degree)]", 1.0, "shear", 180 / np.pi),
        ("G [N/m]", 50.0, "shear", 50.0),
        ("2HG [cN/cm]", 0.5, "shear_hysteresis", 0.5),
        ("W [g/m²]", 162.9, "areal_density", 0.1629),
    ],
)
def test_a_unit_in_brackets_replaces_the_instrument_s_own(written: str, value: float, field: str, si: float) -> None:
    sheet = {"instrument": "KES-FB", written: value} | ({} if written.startswith("W") else {"W": 10.0})
    assert_allclose(getattr(read_fabric(sheet), field), si, rtol=1e-14)  # rounding


def test_energy_stands_in_for_linearity(tmp_path: Path) -> None:
    """LT = WT / (½ Fmax EMT): 9.3 / (½ 500 0.06) = 0.62 and 14.5 / (½ 500 0.1) = 0.58."""
    without = "".join(line + "\n" for line in KES.splitlines() if not line.startswith("LT"))
    energy, stated = read_fabric(write(tmp_path, "a.yaml", without)), read_fabric(write(tmp_path, "b.yaml", KES))
    assert energy.curve_warp is not None
    assert stated.curve_warp is not None
    assert_allclose(energy.curve_warp.tension, stated.curve_warp.tension, rtol=1e-12, atol=1e-12)  # rounding


def test_an_extension_without_linearity_is_a_secant(tmp_path: Path) -> None:
    """Fabric M1 of Mahnić Naglić et al. 2025: EMT 1.73 and 11.18 %; 490.3325 / 0.0173 = 28343, / 0.1118 = 4386 N/m."""
    fabric = read_fabric({"instrument": "KES-FB", "W": 22.658, "EMT": {"warp": 1.73, "weft": 11.18}})
    assert_allclose((fabric.stretch_warp, fabric.stretch_weft), (28343, 4386), rtol=5e-5)  # rounded here
    assert_allclose(read_fabric("stretch_twill").stretch_warp, fabric.stretch_warp, rtol=2e-3)  # three figures
    assert fabric.curve_warp is None
    assert "stretch_warp: secant from 0 to 490 N/m" in fabric.derived
    light = read_fabric({"instrument": "KES-FB", "W": 20, "EMT": 50.0, "Fmax": 50})
    assert_allclose(light.stretch_warp, 50 * 0.980665 / 0.5, rtol=1e-14)  # rounding


def test_a_fast_sheet_in_si(tmp_path: Path) -> None:
    fabric = read_fabric(write(tmp_path, "suiting.yaml", FAST))
    expected = {
        "areal_density": 0.185,
        "thickness": 0.52e-3,
        "bending_warp": 9.80665e-6 * 185 * 19.0**3 * 1e-6,  # B [µN·m] = 9.81e-6 W [g/m²] C³ [mm³]
        "bending_weft": 9.80665e-6 * 185 * 17.0**3 * 1e-6,
        "shear": 122.583125 / 2.5,  # 123 / EB5 in the instrument's own three figures
    }
    for name, value in expected.items():
        assert_allclose(getattr(fabric, name), value, rtol=1e-12, err_msg=name)  # rounding
    assert_allclose(fabric.shear, 123 / 2.5, rtol=4e-3)  # the manual's rounded constant
    assert fabric.curve_weft is not None
    assert_allclose(fabric.curve_weft.strain, (0, 0.009, 0.021, 0.05), rtol=1e-15)
    assert_allclose(fabric.curve_weft.tension, (0, 4.903325, 19.6133, 98.0665), rtol=1e-14)  # 5, 20, 100 gf/cm
    assert_allclose(fabric.stretch_weft, 98.0665 / 0.05, rtol=1e-14)  # rounding
    assert set(fabric.assumed) == {
        "poisson", "bending_hysteresis", "friction", "stretch_hysteresis", "shear_hysteresis", "damping",
    }  # fmt: skip


def test_a_stiff_thread_whose_extensions_the_dial_rounds_together() -> None:
    fabric = read_fabric({"instrument": "FAST", "W": 200, "E5": 0.0, "E20": 0.3, "E100": {"warp": 0.3, "weft": 1.0}})
    assert fabric.curve_warp is not None
    assert fabric.curve_warp.strain == (0.0, 0.003)
    assert fabric.curve_weft is not None
    assert len(fabric.curve_weft.strain) == 3
    assert read_fabric({"instrument": "FAST", "W": 200, "E100": 0.0}).assumed.count("stretch_warp") == 1


@pytest.mark.parametrize(
    ("name", "text", "problem", "line"),
    [
        ("a.yaml", KES.replace("KES-FB", "KES-FX"), "instrument: 'KES-FX' is not supported", 1),
        ("a.yaml", KES.replace("W: 16.29\n", ""), "W: missing (mass per area [mg/cm²])", None),
        ("a.yaml", KES.replace("MMD:", "MND:"), "MND: unknown parameter", 16),
        ("a.yaml", KES.replace("W: 16.29", "W: 1629"), "W: mass per area of 1629 mg/cm²; expected 0.1 to 500", 4),
        ("a.yaml", KES.replace("T0: 0.407", "T0 [cm]: 0.0407"), "T0: unit 'cm'; expected one of mm", 5),
        ("a.yaml", KES.replace("T0: 0.407", "T0: {warp: 1, weft: 1}"), "T0: expected one number", 5),
        ("a.yaml", KES.replace("weft: 0.5}", "wfet: 0.5}"), "G: expected warp and weft (got warp, wfet)", 10),
        ("a.yaml", KES.replace("2HB: 0.033", "2HB: .nan"), "2HB: 'nan' is not a number", 14),
        ("a.yaml", KES.replace("2HB: 0.033", "2HB: [1, 2]"), "2HB: '[1, 2]' is not a number", 14),
        ("a.yaml", KES.replace("2HB: 0.033", "2HB: true"), "2HB: 'True' is not a number", 14),
        ("a.yaml", KES + "B [µN·m]: 7\n", "B: given twice", 22),
        ("a.yaml", KES.replace("{warp: 6.0, weft: 10.0}", "{warp: 60, weft: 100}"), "WT / (½ Fmax EMT) is 0.062", 7),
        ("a.yaml", KES.replace("LT: {warp: 0.62", "LT: {warp: 0.9"), "WT / (½ Fmax EMT) is 0.62; expected LT, 0.9", 7),
        ("a.yaml", "instrument: FAST\nW: 200\nE5: 2\nE20: 1\n", "E5: larger than at a heavier load", 3),
        ("a.yaml", "instrument: FAST\nE5: 2\n", "W: missing", None),
        ("a.csv", KES_CSV.replace("2HB, 0.033,", "2HB"), "expected a name and one value, or two", 14),
        ("a.csv", KES_CSV.replace("LT, 0.62, 0.58", "LT, 0.62, 0.58, 0.6"), "expected a name and one value, or two", 7),
        ("a.csv", KES_CSV.replace("LT, 0.62, 0.58", "LT, , 0.58"), "expected a name and one value, or two", 7),
        ("a.csv", KES_CSV.replace("T0, 0.407", "W, 16"), "W: given twice (also in line 5)", 6),
        ("a.csv", KES_CSV.replace("16.29", "sixteen"), "W: 'sixteen' is not a number", 5),
        ("a.csv", "W,\x00", "byte 2 is zero", None),
        ("a.csv", KES_CSV.replace("our laboratory", "a; b").replace("16.29", "x"), "W: 'x' is not a number", 5),
        ("a.csv", '"' + "x" * 90_000, "expected a name and one value", 1),
    ],
)  # fmt: skip
def test_a_wrong_sheet_is_refused_with_its_line(
    tmp_path: Path, name: str, text: str, problem: str, line: int | None
) -> None:
    path = write(tmp_path, name, text)
    with pytest.raises(InputError) as caught:
        read_fabric(path)
    assert problem in caught.value.problem
    assert caught.value.where == (str(path) if line is None else f"{path}, line {line}")


def test_a_csv_without_an_instrument_or_of_great_size_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VtoError, match="areal_density_gsm"):
        read_fabric(write(tmp_path, "a.csv", "W, 16.29\n"))
    with pytest.raises(InputError, match="the limit is 100000"):
        read_fabric(write(tmp_path, "b.csv", "x" * 100_001))


@pytest.mark.parametrize(("name", "text"), [("a.yaml", KES), ("a.csv", KES_CSV), ("b.yaml", FAST)])
def test_damaged_sheets_are_refused_or_sound(tmp_path: Path, name: str, text: str) -> None:
    rng = np.random.default_rng(3)
    whole = np.frombuffer(text.encode(), np.uint8)
    typed = np.frombuffer(b"0123456789.,-:;e {}\n", np.uint8)
    refused = 0
    for i in range(COUNT):
        damaged = whole.copy()
        at = rng.integers(0, len(whole), rng.integers(1, 4))
        damaged[at] = rng.integers(0, 256) if i % 4 == 0 else rng.choice(typed, len(at))
        end = rng.integers(len(whole) // 2, len(whole) + 1) if i % 4 == 1 else len(whole)
        path = tmp_path / name
        path.write_bytes(damaged[:end].tobytes())
        try:
            read_fabric(path)  # Fabric's constructor checks what comes out
        except VtoError:
            refused += 1
    assert COUNT // 4 < refused < COUNT
