"""Check the set-up of a recording and propose a correction, one kind of mistake at a time.

Wrong units mask wrong axes, and wrong axes mask wrong labels: the first kind detected is proposed, the next
one after confirmation and another analysis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from math import degrees, radians
from typing import Final

import numpy as np

from sagittal.core.agreement import Agreement, AgreementParams
from sagittal.core.agreement.agree import compare_sensors
from sagittal.core.agreement.exchange import find_exchange
from sagittal.core.frames import FOOT, GRAVITY, SHANK, SIDES, THIGH, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.quality.sides import find_left_leg
from sagittal.core.quality.signals import Facts, measure_signal, measure_stream
from sagittal.core.quality.suspicion import list_suspicions
from sagittal.core.setup.axes import CHOICES, REVERSED, fit_axes, refuses_choice
from sagittal.core.setup.params import SetupParams
from sagittal.core.setup.repair import SetupRepair
from sagittal.core.signals.correction import AGAINST, AS_READ, SensorCorrection, name_axes
from sagittal.core.signals.recording import ImuStream, Recording, UniformRecording

ACC_FACTORS: Final = (1.0, GRAVITY, 1e-3 * GRAVITY, 1.0 / GRAVITY)
GYR_FACTORS: Final = (1.0, radians(1.0), degrees(1.0))


def propose_repair(
    recording: Recording,
    uniform: UniformRecording,
    params: SetupParams | None = None,
    agreement: AgreementParams | None = None,
) -> SetupRepair | None:
    """Errors in units or axes, checked before the sensors are compared with each other; None if none are
    detected.

    Parameters
    ----------
    recording : as read. uniform : the same recording on the uniform axis.
    """
    params, agreement = params or SetupParams(), agreement or AgreementParams()
    imu_streams = {s: recording.streams[x.device_id] for s, x in uniform.sensors.items()}
    return _propose_units(imu_streams) or _propose_axes(uniform, params, agreement)


def propose_labels(uniform: UniformRecording, agreed: Agreement) -> SetupRepair | None:
    """Label errors found by comparing sensors, other than swaps that an analysis corrects automatically."""
    exchange = agreed.exchange
    if exchange is not None and exchange.mirrored:
        turned = {uniform.sensors[s].device_id: SensorCorrection(acc_axes=AGAINST) for s in exchange.mirrored}
        which = _list(sorted(exchange.mirrored))
        message = Message(
            "The accelerometer of {which} has inverted axes: adjacent joints match its mirror image.",
            which=which,
        )
        return SetupRepair("axes", (message,), exchange.ratio, corrections=turned)
    if exchange is not None and exchange.mixed_up:
        segments = {uniform.sensors[x].device_id: s for s, x in exchange.mixed_up.items()}
        moved: list[str] = [
            Message("the sensor assigned to {value} is worn on {value2}", value=x, value2=s)
            for s, x in exchange.mixed_up.items()
            if s != x
        ]
        message = Message("Joint motion shows that sensors are swapped: {moved}.", moved=_list(moved))
        return SetupRepair("labels", (message,), exchange.ratio, segments)
    if exchange is None or exchange.cosine is None:
        return _propose_legs(uniform)
    return None


def _propose_units(streams: Mapping[Segment, ImuStream]) -> SetupRepair | None:
    """Scale factors of sensors with a physically impossible unit, if exactly one simple change resolves
    it.
    """
    corrections: dict[str, SensorCorrection] = {}
    named: list[str] = []
    for segment, stream in streams.items():
        wrong = _list_errors(stream, measure_stream(stream), stream.acc)
        if not wrong:
            continue
        signs = AS_READ if "gravity_sign" not in wrong else AGAINST
        tried = [
            SensorCorrection(acc_axes=signs, acc_times=a, gyr_times=g)
            for a, g in product(ACC_FACTORS, GYR_FACTORS)
        ]
        good = [x for x in tried if not _list_remaining(stream, x)]
        least = min((len(x.to_json()) for x in good), default=0)
        simplest = [x for x in good if len(x.to_json()) == least]
        if len(simplest) == 1:
            corrections[stream.device_id] = simplest[0]
            named.append(segment)
    if not corrections:
        return None
    if len(set(corrections.values())) == 1 and 2 * len(corrections) > len(streams):
        # one that moves too little to be refused was read like the others of its export
        one = next(iter(corrections.values()))
        remaining = {s: x for s, x in streams.items() if x.device_id not in corrections}
        follow = {s: x for s, x in remaining.items() if not _list_remaining(x, one)}
        corrections |= {x.device_id: one for x in follow.values()}
        named += follow
    return SetupRepair(
        "units",
        (Message("The units or signs of {said} are not plausible for body motion.", said=_list(named)),),
        np.inf,
        {},
        corrections,
    )


def _list_remaining(stream: ImuStream, correction: SensorCorrection) -> set[str]:
    """Codes of the errors that remain for a sensor after correction."""
    acc = correction.correct_acc(stream.acc)
    gyr = None if stream.gyr is None else correction.correct_gyr(stream.gyr)
    return _list_errors(stream, measure_signal(acc, gyr, stream.rate_hz), acc)


def _list_errors(stream: ImuStream, facts: Facts, acc: Floats) -> set[str]:
    suspicions = list_suspicions(stream.device_id, facts, acc, stream.quat)
    return {n.code for n in suspicions if n.severity == "error"}


def _propose_axes(
    uniform: UniformRecording, params: SetupParams, agreement: AgreementParams
) -> SetupRepair | None:
    """Corrections of gyroscopes that do not rotate gravity consistently with their accelerometer."""
    axis_fits = {s: fit_axes(x, uniform.rate_hz, params) for s, x in uniform.sensors.items()}
    wrong = {s: f.misfits for s, f in axis_fits.items() if f is not None and f.misfits is not None}
    if not wrong:
        return None
    which = _list(sorted(wrong))
    evidence: list[str] = [
        Message(
            "The gyroscope of {which} does not match its accelerometer; other axes or units do.",
            which=which,
        )
    ]
    margin = min(fits[0] / fits[1:].min() for fits in wrong.values())
    count = len([f for f in axis_fits.values() if f is not None])
    gyr = _choose_axes(wrong, count, params)
    if gyr is not None and 2 * len(wrong) > count and len(wrong) > 1:
        # one that hardly moves follows the others of its export
        one = next(iter(gyr.values()))
        gyr |= {
            s: one
            for s, x in uniform.sensors.items()
            if s not in gyr and not refuses_choice(x, uniform.rate_hz, one, params)
        }
    if gyr is None:
        return SetupRepair("axes", tuple(evidence), margin)
    turned = _judge_hands(uniform, gyr, agreement)
    if turned is None and not any(_leaves_hands_open(x) for x in gyr.values()):
        turned = frozenset()
    if turned is None:
        evidence.append("These sensors do not show whether its accelerometer is inverted as well.")
        return SetupRepair("axes", tuple(evidence), margin)
    corrections = {
        uniform.sensors[s].device_id: _correct_gyr(x, AGAINST if s in turned else AS_READ)
        for s, x in gyr.items()
    }
    only_units = all(not x.turns_axes for x in corrections.values())
    return SetupRepair("units" if only_units else "axes", tuple(evidence), margin, corrections=corrections)


def _correct_gyr(gyr: Floats, acc_axes: tuple[str, ...]) -> SensorCorrection:
    """The correction that multiplies a gyroscope by one of `CHOICES`."""
    return SensorCorrection(acc_axes, name_axes(gyr), gyr_times=float(np.abs(gyr).max()))


def _choose_axes(
    wrong: Mapping[Segment, Floats], count: int, params: SetupParams
) -> dict[Segment, Floats] | None:
    """Correction matrix for each gyroscope; None if several fit equally well.

    Sensors of one export are parsed alike: if most of them are wrong they are judged together.
    """
    if 2 * len(wrong) > count and len(wrong) > 1:
        # every sensor counts by how well it can be told
        shares = [np.log(fits / fits[1:].min()) for fits in wrong.values()]
        one = _choose_one(np.exp(np.mean(shares, axis=0)), params)
        return None if one is None else dict.fromkeys(wrong, one)
    choices = {segment: _choose_one(fits, params) for segment, fits in wrong.items()}
    clear = {segment: one for segment, one in choices.items() if one is not None}
    return clear if len(clear) == len(choices) else None


def _choose_one(misfits: Floats, params: SetupParams) -> Floats | None:
    """The only one of `CHOICES` not ruled out; inversion of all signs if that is the best of several."""
    best = int(np.argmin(misfits))
    is_unique = np.count_nonzero(misfits <= params.distinct * misfits[best]) == 1
    return np.asarray(CHOICES[best]) if is_unique or best == REVERSED else None


def _leaves_hands_open(gyr: Floats) -> bool:
    """Whether a left-handed accelerometer is as plausible as a correct one, given the gyroscope correction.

    If all signs are inverted the file may have left-handed axes; a rotation of the gyroscope may equally be a
    sign error of the accelerometer. Otherwise two mistakes would be required.
    """
    a_unit = np.array_equal(gyr, gyr[0, 0] * np.eye(3)) and gyr[0, 0] > 0.0
    return not a_unit and bool(np.linalg.det(gyr) > 0.0 or np.array_equal(gyr, -np.eye(3)))


def _judge_hands(
    uniform: UniformRecording, gyr: Mapping[Segment, Floats], agreement: AgreementParams
) -> frozenset[Segment] | None:
    """Segments whose accelerometer must be inverted along with the gyroscope; None = unknown.

    Left-handed axes of a whole export produce a mirror image, which only the hips reveal, left and right of
    the direction of the feet. Swapped legs would look the same; one mistake is likelier than two.
    """
    fixed = {
        s: x.change(gyr=np.ascontiguousarray(x.gyr @ gyr[s].T)) if s in gyr else x
        for s, x in uniform.sensors.items()
    }
    joints, terms = compare_sensors(replace(uniform, sensors=fixed), agreement.joints)
    chain = {s for w in joints if len(w.t_s) for s in (w.first, w.second)}
    if not chain.issuperset(gyr):
        return None
    exchange = find_exchange(terms, joints, uniform.rate_hz, agreement.joints, agreement.exchange)
    if len(gyr) < len(chain):
        # the others are right, so whoever is a mirror image of them is turned round
        return exchange.mirrored if exchange.mirrored <= frozenset(gyr) else None
    if exchange.mirrored or exchange.cosine is None or abs(exchange.cosine) < -agreement.exchange.cosine:
        return None
    return frozenset(gyr) if exchange.cosine < 0.0 else frozenset()


LOOK_HZ: Final = 50.0


def _propose_legs(uniform: UniformRecording) -> SetupRepair | None:
    """Propose swapped legs if the pelvis accelerates towards the leg labelled as the stance leg."""
    pelvis = uniform.sensors.get("pelvis")
    pair = next((p for p in (FOOT, SHANK, THIGH) if set(p.values()) <= set(uniform.sensors)), None)
    if pelvis is None or pair is None:
        return None
    left, right = (uniform.sensors[pair[side]] for side in ("left", "right"))
    thin = max(1, round(uniform.rate_hz / LOOK_HZ))
    first, second = (np.linalg.norm(x.gyr - np.median(x.gyr, axis=0), axis=1)[::thin] for x in (left, right))
    left_leg = find_left_leg(pelvis.acc[::thin], pelvis.gyr[::thin], first, second, uniform.rate_hz / thin)
    if left_leg != 2:
        return None
    swapped: dict[Segment, Segment] = {
        p[side]: p[opposite]
        for p in (FOOT, SHANK, THIGH)
        for side, opposite in zip(SIDES, reversed(SIDES), strict=True)
    }
    segments = {x.device_id: swapped.get(s, s) for s, x in uniform.sensors.items()}
    evidence = (
        "The pelvis is pushed away from the swing leg: the left and right sensors appear to be swapped."
    )
    return SetupRepair("labels", (evidence,), 1.0, segments)


def _list(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))
