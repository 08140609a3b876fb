"""ErKF as printed: whole matrices F, H and G, one stacked update per step, in plain numpy.

Measurements, noise and rules are those of core/body/erkf/filter.py, without its code: a reference for results
and speed of the compiled loops. Equation numbers: Potter 2021.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from sagittal.core.body.erkf.filter import ErkfInputs, ErkfState
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import ImuTree
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.rotation import exp, multiply, to_matrix

EYE, UP = np.eye(3), np.array([0.0, 0.0, 1.0])


def skew(a: Floats) -> Floats:
    """[a]×."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def right_jacobian(phi: Floats) -> Floats:
    """J_r(φ): Exp(φ + δ) = Exp(φ) Exp(J_r δ)."""
    angle = float(np.linalg.norm(phi))
    K = skew(phi)
    if angle < 1e-4:
        return EYE - 0.5 * K + K @ K / 6.0
    second = (angle - np.sin(angle)) / angle**3
    return np.asarray(EYE - (1.0 - np.cos(angle)) / angle**2 * K + second * K @ K)


class Textbook:
    """The filter's state between samples; `step` takes the next one."""

    def __init__(self, state: ErkfState, inputs: ErkfInputs, tree: ImuTree, params: ErkfParams) -> None:
        self.x, self.P, self.before = state.nominal.copy(), state.P.copy(), state.before.copy()
        self.refused = np.zeros(len(tree.imus), int)
        self.inputs, self.tree, self.params, self.m = inputs, tree, params, params.states
        self.first = 1.0 if params.integration == "euler" else 0.5
        self.reaccept = max(1, round(params.reaccept_s / float(np.median(inputs.step_s[1:]))))

    def step(self, k: int) -> None:
        """Sample k of the inputs."""
        self.predict(k)
        rows = self.rows(k)
        H = np.concatenate([h for h, _, _ in rows])
        y = np.concatenate([r for _, r, _ in rows])
        C = np.diag(np.concatenate([np.full(len(r), var) for _, r, var in rows]))
        S = H @ self.P @ H.T + C
        gain = np.linalg.solve(S, H @ self.P).T
        d = gain @ y
        self.P = (np.eye(len(d)) - gain @ H) @ self.P
        self.inject(d)

    def predict(self, k: int) -> None:
        """Eq 8 to 15, with both ends of the step and the exact derivative."""
        dt, p, n = self.inputs.step_s[k], self.params, len(self.x)
        F, Q = [], []
        for i in range(n):
            was, new = self.before[i], np.concatenate((self.inputs.acc[k, i], self.inputs.gyr[k, i]))
            x = self.x[i]
            phi = (self.first * was[3:] + (1.0 - self.first) * new[3:] - x[10:13]) * dt
            f0, f1 = self.first * (was[:3] - x[13:]), (1.0 - self.first) * (new[:3] - x[13:])
            R0 = to_matrix(x[6:10])
            x[6:10] = multiply(x[6:10], exp(phi))
            R1 = to_matrix(x[6:10])
            a = R0 @ f0 + R1 @ f1 - GRAVITY * UP
            x[0:3] += x[3:6] * dt + 0.5 * a * dt**2
            x[3:6] += a * dt
            turn, by_bias = to_matrix(exp(-phi)), -right_jacobian(phi) * dt
            block = np.eye(15)
            block[0:3, 3:6] = dt * EYE
            block[6:9, 6:9], block[6:9, 9:12] = turn, by_bias
            block[3:6, 6:9] = -dt * (R0 @ skew(f0) + R1 @ skew(f1) @ turn)
            block[3:6, 9:12] = -dt * R1 @ skew(f1) @ by_bias
            block[3:6, 12:15] = -dt * (self.first * R0 + (1.0 - self.first) * R1)
            block[0:3, 6:15] = 0.5 * dt * block[3:6, 6:15]
            F.append(block[: self.m, : self.m])
            acc = p.acc_sd**2 + p.impact**2 * np.sum((new[:3] - was[:3]) ** 2)
            gyr = p.gyr_sd_of.get(self.tree.imus[i], p.gyr_sd) ** 2
            if not self.inputs.valid[k, i]:
                acc, gyr = p.gap_acc_sd**2, p.gap_gyr_sd**2
            var = (0.0, acc * dt**2, gyr * dt**2, p.gyr_walk**2 * dt, p.acc_walk**2 * dt)
            Q.append(np.repeat(var, 3)[: self.m])
            self.before[i] = new
        whole = block_diag(*F)
        self.P = whole @ self.P @ whole.T + np.diag(np.concatenate(Q))

    def at(self, i: int, offset: int) -> slice:
        """Place of one error of IMU i."""
        return slice(i * self.m + offset, i * self.m + offset + 3)

    def rows(self, k: int) -> list[tuple[Floats, Floats, float]]:
        """H (r, N), residual (r,) and variance of every measurement of sample k (eq 28 to 35)."""
        p, N = self.params, len(self.P)
        R = to_matrix(self.x[:, 6:10])
        selection = [self.accepts(k, i) for i in range(len(self.x))]
        result = []
        for joint in self.tree.joints:
            i, j = joint.proximal, joint.distal
            ends = [] if p.joint_centre_sd is None else [(joint.r_proximal, joint.r_distal, True)]
            if p.joint_axis_sd is not None and joint.e_proximal is not None and joint.e_distal is not None:
                ends.append((joint.e_proximal, joint.e_distal, False))
            for a, b, centre in ends:
                H = np.zeros((3, N))
                H[:, self.at(i, 6)], H[:, self.at(j, 6)] = -R[i] @ skew(a), R[j] @ skew(b)
                y, var = R[j] @ b - R[i] @ a, (p.joint_axis_sd or 0.0) ** 2
                if centre:
                    H[:, self.at(i, 0)], H[:, self.at(j, 0)] = EYE, -EYE
                    y = y + self.x[j, 0:3] - self.x[i, 0:3]
                    var = (p.joint_centre_sd or 0.0) ** 2 + self.second_order(R, i, j, a, b)
                result.append((H, y, var))
        for i in range(len(self.x)):
            f = self.inputs.acc[k, i]
            if selection[i]:
                H = np.zeros((3, N))
                H[:, self.at(i, 3)] = EYE
                result.append((H, -self.x[i, 3:6], p.zero_velocity_sd**2))
            if p.tilt_sd is not None and (selection[i] or self.inputs.still[k, i]):
                H = np.zeros((3, N))
                H[:, self.at(i, 6)] = skew(R[i].T @ UP)
                result.append((H, f / np.linalg.norm(f) - R[i].T @ UP, p.tilt_sd**2))
        return result

    def second_order(self, R: Floats, i: int, j: int, a: Floats, b: Floats) -> float:
        """½ σ⁴ |r_xy|² of both levers for the variance σ² of the relative heading, ½ σ⁴ at most 1.5."""
        apart = np.zeros(len(self.P))
        apart[self.at(i, 6)], apart[self.at(j, 6)] = R[i].T @ UP, -R[j].T @ UP
        levers = np.concatenate(((R[i] @ a)[:2], (R[j] @ b)[:2]))
        return float(min(0.5 * (apart @ self.P @ apart) ** 2, 1.5) * levers @ levers)

    def accepts(self, k: int, i: int) -> bool:
        """The gate on a zero velocity, and its rule of re-acceptance
        (docs/science/erkf.md, "Zero velocity")."""
        if not self.inputs.contact[k, i]:
            self.refused[i] = 0
            return False
        p, v, index = self.params, self.x[i, 3:6], self.at(i, 3)
        S = self.P[index, index] + p.zero_velocity_sd**2 * EYE
        if p.gate is None or v @ np.linalg.solve(S, v) <= p.gate:
            self.refused[i] = 0
            return True
        self.refused[i] += 1
        if self.refused[i] < self.reaccept:
            return False
        self.P[self.at(i, 0), self.at(i, 0)] += p.reaccept_m**2 * EYE
        self.P[index, index] += v @ v * EYE
        return True

    def inject(self, d: Floats) -> None:
        """State ⊞ d and the reset G P Gᵀ (eq 27)."""
        m, G = self.m, np.eye(len(d))
        for i, x in enumerate(self.x):
            e = d[i * m : (i + 1) * m]
            x[0:6] += e[0:6]
            x[6:10] = multiply(x[6:10], exp(e[6:9]))
            x[10:16] += np.concatenate((e[9:], np.zeros(15 - m)))
            G[self.at(i, 6), self.at(i, 6)] = EYE - 0.5 * skew(e[6:9])
        P = G @ self.P @ G.T
        self.P = 0.5 * (P + P.T)
