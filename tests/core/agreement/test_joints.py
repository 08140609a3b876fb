"""Which sensors share a joint."""

from __future__ import annotations

from sagittal.core.agreement.joints import CHAINS, LEG_JOINTS, list_worn_joints


def test_a_joint_needs_both_its_sensors() -> None:
    assert list_worn_joints(("foot_l", "pelvis", "thigh_r", "foot_r", "chest")) == (("pelvis", "thigh_r"),)
    assert list_worn_joints(("shank_l", "foot_r", "thigh_l", "foot_l")) == (
        ("thigh_l", "shank_l"),
        ("shank_l", "foot_l"),
    )
    assert list_worn_joints(()) == ()


def test_joints_run_from_the_pelvis_down_on_one_side() -> None:
    assert sorted(LEG_JOINTS.values()) == ["ankle", "ankle", "hip", "hip", "knee", "knee"]
    for proximal, distal in LEG_JOINTS:
        assert proximal == "pelvis" or proximal[-1] == distal[-1]
    assert LEG_JOINTS["pelvis", "thigh_l"] == "hip"
    assert LEG_JOINTS["shank_r", "foot_r"] == "ankle"


def test_a_chain_of_one_clock_has_one_joint_to_the_rest() -> None:
    for chain in CHAINS:
        lateral = [j for j in LEG_JOINTS if len(set(j) & set(chain)) == 1]
        assert len(lateral) == 1
        assert lateral[0][1] == chain[0]
    assert len(CHAINS) == 4
