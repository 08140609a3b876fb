"""Poses of seven segments from three IMUs or two by Sy's L7S; the filter is in core/body/l7s/filter.py.

A sparse mode of visibly lower accuracy: never take stride lengths from it if a better source is available
(docs/science/l7s.md, "Limits").
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final, get_args

import numpy as np

from sagittal.core.body.l7s.checks import SeenWalk, longest_gaps, walking_checks
from sagittal.core.body.l7s.filter import L7sInputs, L7sParams, Worn, filter_block, start_l7s_state
from sagittal.core.body.l7s.health import l7s_health, list_health_notices
from sagittal.core.body.l7s.inputs import KnownSamples, L7sTake, bodies_of, take_of
from sagittal.core.body.l7s.legs import BODIES, FIGURE, LEGS, LegModel, solve_legs
from sagittal.core.body.l7s.smoother import smooth_track
from sagittal.core.body.l7s.windows import PlacedWindow, place_windows
from sagittal.core.body.model import NOMINAL_HEIGHT_M, BodyModel
from sagittal.core.body.poses import Poses, figure_precision
from sagittal.core.errors import Notice
from sagittal.core.estimators import L7S_2I, L7S_3I
from sagittal.core.frames import FOOT, R_NEUTRAL, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.rotation import angle_between, from_matrix
from sagittal.core.signals.held_samples import SampleSeries, cut_blocks, give_pages_back, make_room

STRETCHED_M: Final = 1e-6
"""A leg this close to its full length is at the bound: the knee is within .2° of straight. The projection
leaves 1e-4 m too much with one pass, 1e-8 with two (docs/science/l7s.md, "Legs"); with this
margin the count is the same for any number of passes."""


def l7s_poses(
    orientations: Orientations,
    acceleration: Mapping[Segment, SampleSeries],
    steps: Mapping[Side, Bools],
    body: BodyModel,
    params: L7sParams | None = None,
    configuration: Worn | None = None,
    *,
    both_ways: bool = True,
) -> Poses:
    """Poses of the seven segments from pelvis and feet, or from the feet alone.

    Parameters
    ----------
    orientations : of the instrumented segments; others are ignored.
    acceleration : segment → (n, 3) in W without gravity, m/s²
        (`sagittal.core.body.l7s.inputs.free_acceleration`).
    steps : side → (n,) foot still on the floor: zero velocity, not contact.
    configuration : None = 3I with a pelvis, else 2I. both_ways : smoothed positions
        (core/body/l7s/smoother.py); False returns those of the filter, as in live use.

    Returns
    -------
    Poses in ISB frames, method of L7S-3I or L7S-2I, `contact` = steps. After a data loss of a foot they are
    valid again from its next rest on, because its position is unknown until then. The feet's orientation is
    that of the constrained state and differs from the measured one by some degrees (docs/science/l7s.md,
    "Constraints"). Diagnostics by side: `knee_straight_share`, fraction of samples with a foot in motion and
    the leg at full length, where the knee angle is a bound and not a measurement; `hinge_m`, `excess_m`,
    largest residuals of the constraints; `step_share`; `sensor_ahead_m`, estimated distance of the foot
    sensor in front of the middle of the foot (0 with both_ways=False); `foot_turned_rad`, mean angle from
    measured to reported. `passes` of Gauss–Newton and `moved_m`, the largest change of position in the last.
    At the end: `position_sd_m` by body, `min_eigenvalue` of P. By sensor: `gap_s`, the longest data loss. And
    those of `walking_checks`. Health and notices as in health.py; a notice `foot_never_still` if a foot has
    no step.

    Raises
    ------
    EstimationError `sensor_missing`, `segment_length`, `headings_apart`, `bad_signal`, `l7s_diverged`.
    """
    params = params or L7sParams()
    configuration = configuration or ("3I" if "pelvis" in orientations.q else "2I")
    model = LegModel.of(body)
    take = take_of(orientations, acceleration, steps, model, configuration)
    measured, rate = bodies_of(configuration), orientations.rate_hz
    valid = None
    if both_ways:
        valid = np.stack([orientations.valid[s] if s in measured else steps["left"] for s in BODIES], axis=1)
    offsets, windows = place_windows(take, valid, rate, params)
    figure = _Figure(take)
    P = figure.add_all(windows)
    is_known = KnownSamples().push([orientations.valid[s] for s in measured], take.step)
    measured_diagnostics = figure.measure()
    del take, windows
    checks = walking_checks(figure.seen, model, rate)
    poses = Poses(
        t_s=orientations.t_s,
        rate_hz=orientations.rate_hz,
        q=figure.q,
        p=figure.p,
        valid=is_known,
        contact={FOOT[s]: np.asarray(steps[s], bool) for s in LEGS},
        body=body,
        method=(L7S_3I if configuration == "3I" else L7S_2I).method,
        notices=_never_still(steps),
        diagnostics={
            "adjoint": params.adjoint,
            **measured_diagnostics,
            **_describe_filter(steps, offsets, P),
            "gap_s": longest_gaps({s: orientations.valid[s] for s in measured}, rate),
            **checks,
        },
    )
    health = l7s_health(poses)
    return replace(poses, health=health, notices=(*poses.notices, *list_health_notices(health)))


class _Figure:
    """The seven segments of a recording, accumulated window by window, and their diagnostics.

    q, p : as in `Poses`. seen : input of the checks.
    """

    def __init__(self, take: L7sTake) -> None:
        n = len(take.step)
        kind = figure_precision(n)
        self.q: dict[Segment, Floats] = {s: make_room(n, 4, kind=kind) for s in FIGURE}
        self.p: dict[Segment, Floats] = {s: make_room(n, 3, kind=kind) for s in FIGURE}
        self.seen = SeenWalk.make_room(n, pelvis=take.worn == "3I")
        self._model = take.model
        both_still = take.step.all(axis=1)
        self._moving: Bools = np.asarray(~both_still | both_still.all())
        self._passes, self._moved = 0, 0.0
        self._straight, self._hinge, self._excess = np.zeros(2, np.int64), np.zeros(2), np.zeros(2)
        self._turned: list[Floats] = []

    def add(self, window: PlacedWindow) -> None:
        """Add the next samples."""
        length = self._model.thigh + self._model.shank
        self._passes, self._moved = max(self._passes, window.passes), max(self._moved, window.moved)
        for part in cut_blocks(len(window.R)):
            R, inputs, track = window.R[part], window.inputs.part(part), window.track.part(part)
            legs = solve_legs(R, window.p[part], self._model)
            samples = slice(window.first + part.start, window.first + part.stop)
            for i, s in enumerate(FIGURE):
                self.q[s][samples], self.p[s][samples] = legs.q[:, i], legs.p[:, i]
            self.seen.put(samples, SeenWalk.of(inputs, track))
            self._straight += np.count_nonzero(
                legs.reach[self._moving[samples]] > length - STRETCHED_M, axis=0
            )
            self._hinge = np.maximum(self._hinge, np.abs(legs.hinge).max(axis=0))
            self._excess = np.maximum(self._excess, (legs.reach - length).max(axis=0))
            turned, measured = (from_matrix(x[:, 1:].reshape(-1, 3, 3)) for x in (R, inputs.R))
            self._turned.append(angle_between(turned, measured).reshape(-1, 2))
        give_pages_back((*self.q.values(), *self.p.values()))

    def add_all(self, windows: Iterable[PlacedWindow]) -> Floats:
        """Add all windows of the recording, one at a time; returns the final P."""
        P = np.empty((0, 0))
        for window in windows:
            self.add(window)
            P = window.P
            del window
        return P

    def measure(self) -> dict[str, object]:
        """The diagnostics of `l7s_poses` that are accumulated over the windows."""
        turned, moving = np.concatenate(self._turned), np.count_nonzero(self._moving)
        self._turned.clear()
        return {
            "passes": self._passes,
            "moved_m": self._moved,
            "knee_straight_share": {s: float(self._straight[i] / moving) for i, s in enumerate(LEGS)},
            "hinge_m": {s: float(self._hinge[i]) for i, s in enumerate(LEGS)},
            "excess_m": {s: float(self._excess[i]) for i, s in enumerate(LEGS)},
            "foot_turned_rad": {s: float(turned[:, i].mean()) for i, s in enumerate(LEGS)},
        }


def _describe_filter(steps: Mapping[Side, Bools], offsets: Floats, P: Floats) -> dict[str, object]:
    """The diagnostics of `l7s_poses` from steps, sensor positions and covariance."""
    variances = np.diag(P)[:18].reshape(3, 6)[:, :3]
    return {
        "step_share": {s: float(np.mean(steps[s])) for s in LEGS},
        "sensor_ahead_m": {s: float(-offsets[i, 2]) for i, s in enumerate(LEGS)},
        "position_sd_m": {s: float(np.sqrt(x.max())) for s, x in zip(BODIES, variances, strict=True)},
        "min_eigenvalue": float(np.linalg.eigvalsh(P)[0]),
    }


def _never_still(steps: Mapping[Side, Bools]) -> tuple[Notice, ...]:
    return tuple(
        Notice(
            "foot_never_still",
            Message(
                "The {side} foot is never stationary in this trial, so its speed drifts; positions and step "
                "lengths are meaningless. Possible causes: a treadmill or a sensor on another segment.",
                side=side,
            ),
            sensor=FOOT[side],
        )
        for side in LEGS
        if not np.any(steps[side])
    )


def compile_l7s_kernel() -> None:
    """Compile the kernels of filter, smoother and legs or load them, so that the first recording is not
    delayed.
    """
    model = LegModel.of(BodyModel.from_height(NOMINAL_HEIGHT_M))
    foot = model.to_isb("foot_l").T
    n = 40
    R = np.tile(np.stack((np.eye(3), R_NEUTRAL @ foot, R_NEUTRAL @ foot)), (n, 1, 1, 1))
    step = np.ones((n, 2), bool)
    step[10:-10] = False  # a swing, whose ball is looked for
    for configuration in get_args(Worn):
        inputs = L7sInputs(R, np.zeros((n, 3, 3)), step, configuration)
        track, _ = filter_block(start_l7s_state(inputs, model), inputs, model, 100.0)
        smooth_track(track, inputs, np.ones((n, 3), bool), model, 100.0)
        solve_legs(track.R, track.p, model)
