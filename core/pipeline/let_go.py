"""Memory release between stages: an analysis without data not needed by later stages, so that long
recordings fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sagittal.core.body.poses import figure_precision
from sagittal.core.events.lumbar import TRUNK
from sagittal.core.frames import FOOT
from sagittal.core.fusion.orientations import LastReading
from sagittal.core.pipeline.analysis import TakeAnalysis, require_stage
from sagittal.core.signals.recording import UniformRecording


def forget_magnetometers(analysis: TakeAnalysis) -> TakeAnalysis:
    """Drop the magnetometers: after quality only the comparison of filters uses them."""
    source, uniform, agreed = analysis.source, analysis.uniform, analysis.agreed
    streams = {d: s.change(mag=None) for d, s in source.streams.items()}
    analysis = replace(analysis, source=replace(source, streams=streams))
    if uniform is not None:
        analysis = replace(analysis, uniform=_without_magnetometers(uniform))
    if agreed is not None:
        whole = None if agreed.whole is None else _without_magnetometers(agreed.whole)
        reduced = replace(agreed, recording=_without_magnetometers(agreed.recording), whole=whole)
        analysis = replace(analysis, agreed=reduced)
    return analysis


def _without_magnetometers(recording: UniformRecording) -> UniformRecording:
    return replace(recording, sensors={s: x.change(mag=None) for s, x in recording.sensors.items()})


def keep_what_poses_read(analysis: TakeAnalysis) -> TakeAnalysis:
    """Of the orientations before mounting keep only those of the feet, the fallback of `measure_walk`;
    pass those after it only to the estimator, which releases them while refining.
    """
    fused, mounted = require_stage(analysis.fused, "orientation"), require_stage(analysis.mounted, "mounting")
    fused = replace(fused, q={s: q for s, q in fused.q.items() if s in FOOT.values()})
    passed = replace(mounted.orientations, q=LastReading(mounted.orientations.q))
    return replace(analysis, fused=fused, mounted=replace(mounted, orientations=passed))


def keep_refined_alone(analysis: TakeAnalysis) -> TakeAnalysis:
    """Drop the orientations from before the estimator; a foot that it did not refine keeps its own.

    `measure_walk` falls back on those of the feet without angles, whose stage cannot fail.
    """
    mounted, posed = require_stage(analysis.mounted, "mounting"), require_stage(analysis.posed, "poses")
    fused, refined = require_stage(analysis.fused, "orientation"), posed.orientations
    fused = replace(fused, q={s: refined.q.get(s, q) for s, q in fused.q.items()})
    return replace(analysis, fused=fused, mounted=replace(mounted, orientations=refined))


def keep_what_is_measured(analysis: TakeAnalysis) -> TakeAnalysis:
    """Keep orientations of feet and trunk only, on which parameters are based; for a long recording the
    poses in the precision of the file.
    """
    mounted, posed = require_stage(analysis.mounted, "mounting"), require_stage(analysis.posed, "poses")
    retained = {s: q for s, q in posed.orientations.q.items() if s in (*FOOT.values(), *TRUNK)}
    orientations, poses = replace(posed.orientations, q=retained), posed.poses
    kind = figure_precision(len(poses.t_s))
    turned = {s: q if s in retained else np.asarray(q, kind) for s, q in poses.q.items()}
    posed = replace(posed, orientations=orientations, poses=replace(poses, q=turned))
    return replace(analysis, mounted=replace(mounted, orientations=orientations), posed=posed)
