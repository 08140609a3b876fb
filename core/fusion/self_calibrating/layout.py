"""Layout of the arrays of the compiled loops."""

# The error state. World axes unless said; orientation e: R_true = Exp(e) R.
TILT = 0  # 3, orientation, rad
BIAS = 3  # 3, gyroscope, sensor axes, rad/s
SPEED = 6  # 3, velocity, m/s
ACC_BIAS = 9  # 3, sensor axes, m/s²
GRAVITY = 12  # 1, m/s²
MATRIX = 13  # 9, gyroscope's scale and misalignment, row by row, sensor axes
ACC_DELAY = 22  # 1, s
SHAKEN = 23  # 3, bias of the gyroscope per g² of shaking, sensor axes, rad/s
IRON = 26  # 3, hard iron, sensor axes, norms of the field
FIELD = 29  # 3, field of this place less that of the region
MAG_DELAY = 32  # 1, s
REGION = 33  # 3, field of the region that the sensor moves in less that of the start
WITHOUT_MAG, WITH_MAG = 26, 36

# The nominal state: q 0-3, and then in the order of the errors, each `SHIFT` further on from BIAS.
SHIFT = 1
NORTH = 37  # 3, field at the start, its norm 40
NORM = 40
JUMPING = 41  # time for which the field has been off, time to wait after a jump
PAUSE = 42
SUM_ACC = 43  # 3, sums over the start
SUM_MAG = 46  # 3
TURNED = 49  # 4, quaternion since the first sample
MOVED = 53
FIRST_ACC = 54  # 3
PLACE = 57  # 3, the level field over a rest, a sum and then its mean
PLACE_SUMS = 60  # intervals in it, -1 when the rest has been judged
START_R = 61  # 9, orientation in which the field of the start was read, zero where iron is not in it
STATE = 70

# Sums over an interval.
S_R = 0  # 9, R dt
S_R_RATE = 9  # 27, R ⊗ rate dt
S_ACC = 36  # 3, R f dt
S_CROSS = 39  # 3, ω × R f dt
S_GYR = 42  # 3
S_MAG = 45  # 3, R m
S_MAG_CROSS = 48  # 3, ω × R m
S_MAG_R = 51  # 9, R at the magnetometer's time
S_RATE_SQUARE = 60
S_ACC_SQUARE = 61
S_SPEED_SQUARE = 62
S_LOST = 63  # time without samples, s
S_SLOW_SQUARE = 64
S_SHAKING = 65
SUMS = 66

# What tells motion and rest.
M_Q = 0  # 4
M_ACC = 4  # 3, slow part of the acceleration
M_SPEED = 7  # 3
M_SLOW_SPEED = 10  # 3
M_SQUARE = 13
M_GYR = 14  # 3, means over half a second
M_FORCE = 17  # 3
M_REST = 20  # time at rest, s
M_SLOW_SQUARE = 21
MOTION = 22

# What is judged of a sample, by the row.
J_SPEED_SQUARE = 0  # per axis
J_SLOW_SQUARE = 1  # of its slow part, enlarged
J_SHAKING = 2  # squared acceleration, g²
JUDGED = 3

# Counters.
C_SEEN = 0  # valid samples
C_INTERVAL = 1  # samples of the interval
C_REST = 2  # of these at rest
C_MAG = 3  # of these with a field
C_START = 4  # samples of the field in the start, -1 when the start is over
C_RUN = 5  # samples since
C_MOTION = 6  # samples seen by the judge of motion
COUNTERS = 7

RING = 64  # samples of orientation kept for the magnetometer's delay
RING_WIDTH = 7
