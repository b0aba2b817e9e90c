"""What each measurement means: name, definition, where its tape lies on the template, its clause in ISO 8559-1:2017."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.errors import InputError


@dataclass(frozen=True)
class Definition:
    """One measurement.

    Args:
        name: ISO 8559 style name.
        kind: "girth", "loop", "height", "drop", "path", "breadth", "depth", "span" or "mass".
        place: Row, column or landmarks it lies on; a place on a limb has no side, both sides are averaged.
        text: The definition, in our words.
        clause: Clause and title in ISO 8559-1:2017, or empty where the free preview does not name it.
    """

    name: str
    kind: str
    place: str
    text: str
    clause: str = ""


DEFINITIONS = {
    d.name: d
    for d in (
        Definition("stature", "height", "crown", "crown to floor"),
        Definition("mass", "mass", "", "volume times 1000 kg/m3 [kg]"),
        Definition("head_girth", "girth", "head", "horizontal girth of the head at its greatest length"),
        Definition("neck_girth", "girth", "neck", "horizontal girth at mid-neck, below the larynx"),
        Definition(
            "neck_base_girth", "loop", "neck_base", "through back, side and front neck points", "5.3.3 Neck base girth"
        ),
        Definition(
            "chest_girth", "girth", "chest", "horizontal at the bust points, tape under the arms", "5.3.4 Bust girth"
        ),
        Definition("underbust_girth", "girth", "underbust", "horizontal, just below the breasts"),
        Definition("waist_girth", "girth", "waist", "horizontal at the natural waist", "5.3.10 Waist girth"),
        Definition("navel_girth", "girth", "navel", "horizontal at the navel (the waist of ANSUR II)"),
        Definition("high_hip_girth", "girth", "high_hip", "horizontal at the iliac crest's front spine"),
        Definition(
            "hip_girth", "girth", "hip", "horizontal at the greatest protrusion of the seat", "5.3.13 Hip girth"
        ),
        Definition("armscye_girth", "loop", "armscye", "through shoulder point and armpit", "5.3.15 Armscye girth"),
        Definition(
            "upper_arm_girth",
            "girth",
            "upper_arm",
            "across the arm's axis at mid-biceps, arm relaxed",
            "5.3.16 Upper-arm girth",
        ),
        Definition("elbow_girth", "girth", "elbow", "across the arm's axis at the elbow, arm straight"),
        Definition("forearm_girth", "girth", "forearm", "across the arm's axis at the widest forearm"),
        Definition("wrist_girth", "girth", "wrist", "across the arm's axis over the wrist bones"),
        Definition("thigh_girth", "girth", "thigh", "horizontal, just below the fold of the seat"),
        Definition("knee_girth", "girth", "knee", "horizontal at mid-patella"),
        Definition("calf_girth", "girth", "calf", "horizontal at the widest calf"),
        Definition("ankle_girth", "girth", "ankle", "horizontal at the smallest girth above the ankle bones"),
        Definition(
            "shoulder_length",
            "path",
            "shoulder_column",
            "side neck point to shoulder point on the surface",
            "5.4.1 Shoulder length",
        ),
        Definition(
            "back_neck_to_waist",
            "path",
            "back_column:waist",
            "back neck point to waist along the spine",
            "5.4.5 Back neck point to waist",
        ),
        Definition("back_neck_to_navel", "path", "back_column:navel", "back neck point to navel level along the spine"),
        Definition(
            "front_neck_to_waist",
            "path",
            "front_column:waist",
            "front neck point to waist in the median plane",
            "5.4.8 Front neck point to waist",
        ),
        Definition(
            "back_shoulder_width",
            "span",
            "left_shoulder_point right_shoulder_point",
            "straight between the shoulder points",
            "5.4.2 Back shoulder width",
        ),
        Definition(
            "across_back_shoulder_width",
            "span",
            "left_shoulder_point back_neck right_shoulder_point",
            "shoulder points over the back neck point",
            "5.4.3 Across back shoulder width",
        ),
        Definition(
            "across_front_width",
            "span",
            "left_front_fold right_front_fold",
            "between the front armpit folds",
            "5.4.7 Across front width",
        ),
        Definition("back_width", "span", "left_back_fold right_back_fold", "between the rear armpit folds"),
        Definition(
            "back_neck_to_wrist",
            "span",
            "back_neck shoulder_point elbow_point wrist_point",
            "back neck point over shoulder and elbow to wrist",
            "5.4.17 Back neck point to wrist length",
        ),
        Definition(
            "scye_depth",
            "drop",
            "back_neck armpit_point",
            "back neck point down to armpit level",
            "5.4.6 Scye depth length",
        ),
        Definition("torso_height", "drop", "back_neck crotch_point", "back neck point down to the crotch"),
        Definition(
            "outer_arm_length",
            "span",
            "shoulder_point elbow_point wrist_point",
            "shoulder point over elbow to wrist",
            "5.7.8 Outer arm length",
        ),
        Definition("back_neck_height", "height", "back_neck", "back neck point to floor"),
        Definition("shoulder_height", "height", "shoulder_point", "shoulder point to floor"),
        Definition("chest_height", "height", "chest", "bust level to floor"),
        Definition("waist_height", "height", "waist", "waist level to floor"),
        Definition("navel_height", "height", "navel", "navel to floor"),
        Definition("hip_height", "height", "hip", "hip level to floor"),
        Definition("inside_leg", "height", "crotch_point", "crotch to floor"),
        Definition("thigh_height", "height", "thigh", "fold of the seat to floor"),
        Definition("knee_height", "height", "knee", "mid-patella to floor"),
        Definition("chest_depth", "depth", "chest", "front to back at bust level"),
        Definition("waist_breadth", "breadth", "navel", "side to side at the navel"),
        Definition("waist_depth", "depth", "navel", "front to back at the navel"),
        Definition("hip_breadth", "breadth", "hip", "side to side at hip level"),
        Definition("hip_depth", "depth", "hip", "front to back at hip level"),
    )
}
"""All measurements, by name."""

_OTHER_NAMES = {
    "bust_girth": "chest_girth",
    "chest_girth_men": "chest_girth",
    "height": "stature",
    "weight": "mass",
    "arm_length": "outer_arm_length",
    "shoulder_breadth": "back_shoulder_width",
    "back_neck_to_waist_level": "back_neck_to_waist",
    "max_hip_girth": "hip_girth",
    "inseam": "inside_leg",
}


def definition(name: str) -> Definition:
    """Return what a name means, other common names included.

    Raises:
        InputError: an unknown name.
    """
    found = DEFINITIONS.get(_OTHER_NAMES.get(name, name))
    if found is None:
        raise InputError(
            f"measurement {name!r} is not known", hint=f"known: {', '.join(sorted([*DEFINITIONS, *_OTHER_NAMES]))}"
        )
    return found
