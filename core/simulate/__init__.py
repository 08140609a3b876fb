"""Simulated walkers and sensors with exact ground truth, for tests, demo and CLI
(docs/science/simulation.md).
"""

from sagittal.core.simulate.chest import ChestSimulation, ChestTruth, PostureHold, simulate_day
from sagittal.core.simulate.functional import (
    FunctionalSimulation,
    FunctionalTruth,
    SwingsAndBows,
    simulate_swings_and_bows,
)
from sagittal.core.simulate.gait.soft_tissue import SoftTissue
from sagittal.core.simulate.magnetics import Dipole
from sagittal.core.simulate.mems import SensorNoise
from sagittal.core.simulate.movements import MOVEMENTS, Movement, simulate_movement
from sagittal.core.simulate.mt_text import mt_files, mt_text
from sagittal.core.simulate.patients import PATIENTS, SimulatedPatient
from sagittal.core.simulate.phases import Phase, phase_table
from sagittal.core.simulate.script import Arc, Pivot, Script, SingleSteps, Stand, Straight, Tremble
from sagittal.core.simulate.scripts import IMPAIRED_WALKS, SCRIPTS, Scenario, simulate_scenario
from sagittal.core.simulate.setup import Dropout, Lag, RecordingSetup
from sagittal.core.simulate.simulation import Simulation, simulate
from sagittal.core.simulate.squat import Squats, SquatSimulation, SquatTruth, simulate_squats
from sagittal.core.simulate.standing import Sway, SwaySimulation, SwayTruth, simulate_sway
from sagittal.core.simulate.tables import angle_table, event_table, stride_table
from sagittal.core.simulate.truth import WalkTruth
from sagittal.core.simulate.tug import ChairSimulation, ChairTruth, simulate_chair_rises, simulate_tug
from sagittal.core.simulate.walker import STEADY, SideGait, Variability, Walker

__all__ = [
    "IMPAIRED_WALKS",
    "MOVEMENTS",
    "PATIENTS",
    "SCRIPTS",
    "STEADY",
    "Arc",
    "ChairSimulation",
    "ChairTruth",
    "ChestSimulation",
    "ChestTruth",
    "Dipole",
    "Dropout",
    "FunctionalSimulation",
    "FunctionalTruth",
    "Lag",
    "Movement",
    "Phase",
    "Pivot",
    "PostureHold",
    "RecordingSetup",
    "Scenario",
    "Script",
    "SensorNoise",
    "SideGait",
    "SimulatedPatient",
    "Simulation",
    "SingleSteps",
    "SoftTissue",
    "SquatSimulation",
    "SquatTruth",
    "Squats",
    "Stand",
    "Straight",
    "Sway",
    "SwaySimulation",
    "SwayTruth",
    "SwingsAndBows",
    "Tremble",
    "Variability",
    "WalkTruth",
    "Walker",
    "angle_table",
    "event_table",
    "mt_files",
    "mt_text",
    "phase_table",
    "simulate",
    "simulate_chair_rises",
    "simulate_day",
    "simulate_movement",
    "simulate_scenario",
    "simulate_squats",
    "simulate_sway",
    "simulate_swings_and_bows",
    "simulate_tug",
    "stride_table",
]
