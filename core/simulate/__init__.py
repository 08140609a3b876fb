"""Simulated walkers and sensors with exact truth, for tests, demo and CLI (docs/simulation.md)."""

from core.simulate.chest import ChestSimulation, ChestTruth, PostureHold, simulate_day
from core.simulate.functional import (
    FunctionalSimulation,
    FunctionalTruth,
    SwingsAndBows,
    simulate_swings_and_bows,
)
from core.simulate.magnetics import Dipole
from core.simulate.mems import SensorNoise
from core.simulate.movements import MOVEMENTS, Movement, simulate_movement
from core.simulate.mt_text import mt_files, mt_text
from core.simulate.patients import PATIENTS, SimulatedPatient
from core.simulate.phases import Phase, phase_table
from core.simulate.script import Arc, Pivot, Script, SingleSteps, Stand, Straight
from core.simulate.scripts import SCRIPTS, Scenario, simulate_scenario
from core.simulate.setup import Dropout, Lag, RecordingSetup
from core.simulate.simulation import Simulation, simulate
from core.simulate.soft_tissue import SoftTissue
from core.simulate.squat import Squats, SquatSimulation, SquatTruth, simulate_squats
from core.simulate.standing import Sway, SwaySimulation, SwayTruth, simulate_sway
from core.simulate.tables import angle_table, event_table, stride_table
from core.simulate.truth import WalkTruth
from core.simulate.tug import ChairSimulation, ChairTruth, simulate_chair_rises, simulate_tug
from core.simulate.walker import STEADY, SideGait, Variability, Walker

__all__ = [
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
