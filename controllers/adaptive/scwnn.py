"""Adaptive sliding mode control by a self-constructing wavelet network (the thesis' chapter 3).

The structure, x'' = f(X) + g(X) u + d with X = [x, x'], is unknown; f and the diagonal of
g are learnt while they are used. Numbers are those of the thesis' equations.

    e = x - x_d                                                              (3.3)
    s = e' + k1 e + k2 int e dt                                              (3.6)
    phi_i = 2/(sqrt 3 pi^(1/4)) (1 - zeta^2) exp(-zeta^2/2),
            zeta = |(X - c_i)/sigma_i|                                       (3.14)
    f_j = w_j phi + b_j X,   g_jj = theta_jj phi                             (3.20), (3.19)
    w = eta_pw w_p + eta_iw w_i, b and theta likewise                        (3.28), (3.29)
    w_p = w_i' = s_j phi                                                     (3.45)
    theta_p = theta_i' = s_j u_j phi                                         (3.46)
    b_p = b_i' = s_j X                                                       (3.47)
    sigma' = eta_sigma A sum_j s_j (w_j + u_j theta_j)                       (3.48)
    c' = eta_c B sum_j s_j (w_j + u_j theta_j)                               (3.49)
    u_a1 = eta_pw w_p phi + eta_pb b_p X + eta_pt theta_p phi u              (3.51)
    u_a2 = r mu_sum,  r' = -eta_r s mu_sum                                   (3.53), (3.60)
    u = (-f + x_d'' - k1 e' - k2 e + u_a1 + u_a2) / g                        (3.8), (3.63)

Here x_d = 0. A node is added when the input is far from the nearest node and the error of
the last five samples is large, (3.34) to (3.39); the weakest is dropped when it contributes
less than E3 of the strongest (3.40). Memory is fixed: the network has at most `n_nodes`
nodes, and `full` counts the nodes that could not be added.

The code differs from the print where that is incomplete or wrong:
- In (3.51) w_p and b_p have the wrong sign to cancel their terms in (3.44); here all three
  terms cancel.
- g starts at zero, and (3.46) drives it below zero wherever s u < 0, so u is divided by
  max(g, g_min). u is in units of u_max, so g is an acceleration.
- (3.40) compares min phi with max phi. A Mexican hat is negative beyond zeta = 1, so sizes
  |phi| are compared. The most central node is never dropped.
- The width of the triangles of figure 3.3 is not printed. s_max is the peak of the outermost
  triangle, beyond which they saturate.
- r falls without bound while s differs from zero, even by measurement noise, so `leak` r is
  added to (3.60). leak = 0 gives the printed equation.

X is sampled at t_k and u is held over [t_k, t_{k+1}]; u in (3.46) to (3.51) is the one held
over [t_{k-1}, t_k], after the actuators' limit.
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import Any

from cosim import Block, Input, Local, Output, Parameter

_MEXICAN_HAT = 2.0 / (sqrt(3.0) * pi**0.25)


class SCWNN(Block):
    """Self-constructing wavelet network with fuzzy compensation, one actuator a displacement."""

    k1 = Parameter(100.0, "weight of the displacement in s", unit="1/s", min=0.0)
    k2 = Parameter(100.0, "weight of the integral in s", unit="1/s^2", min=0.0)
    e_max = Parameter(0.05, "start of the threshold E1 on the distance", min=0.0)
    e_min = Parameter(0.001, "end of the threshold E1", min=0.0)
    d_max = Parameter(0.05, "start of the threshold E2 on the error", min=0.0)
    d_min = Parameter(0.005, "end of the threshold E2", min=0.0)
    beta = Parameter(0.97, "decay of E1 for each sample", min=0.0, max=1.0)
    gamma = Parameter(0.97, "decay of E2 for each sample", min=0.0, max=1.0)
    E3 = Parameter(0.01, "pruning threshold", min=0.0)
    rho = Parameter(0.8, "width of a new node over its distance from the nearest", min=0.0)
    eta_sigma = Parameter(0.001, "rate of the widths", min=0.0)
    eta_c = Parameter(0.001, "rate of the centres", min=0.0)
    eta_pw = Parameter(0.001, "weights w, proportional", min=0.0)
    eta_iw = Parameter(0.01, "weights w, integral", min=0.0)
    eta_pb = Parameter(0.001, "linear weights b, proportional", min=0.0)
    eta_ib = Parameter(0.01, "linear weights b, integral", min=0.0)
    eta_pt = Parameter(0.001, "weights theta, proportional", min=0.0)
    eta_it = Parameter(0.01, "weights theta, integral", min=0.0)
    eta_r = Parameter(10.0, "rate of the fuzzy compensation", min=0.0)
    leak = Parameter(0.0, "rate at which the fuzzy compensation decays", unit="1/s", min=0.0)
    s_max = Parameter(33.0, "peak of the outermost triangle", min=1e-9)
    g_min = Parameter(100.0, "smallest g that u is divided by", unit="m/s^2", min=1e-9)
    u_max = Parameter(1e6, "unit and limit of the force", unit="N", min=1e-9)

    x = Input("displacements", unit="m", shape="p")
    v = Input("velocities", unit="m/s", shape="p")
    u = Output("forces", unit="N", shape="p")
    s = Output("sliding variables", shape="p")
    nodes = Output("number of nodes", unit="1")
    full = Output("number of nodes that could not be added", unit="1")
    f = Output("estimate of f", unit="m/s^2", shape="p")
    r = Output("fuzzy compensation", shape="p")

    # sizes: p displacements with an actuator each, n = 2 p, n_nodes nodes at most
    integral = Local(0.0, "int e dt", shape="p")
    X = Local(0.0, "displacements, then velocities", shape="n")
    c = Local(0.0, "centres of the nodes", shape=("n_nodes", "n"))
    sigma = Local(0.0, "widths of the nodes", shape=("n_nodes", "n"))
    w = Local(0.0, "w_i, integral part of w", shape=("n_nodes", "p"))
    theta = Local(0.0, "theta_i, integral part of theta", shape=("n_nodes", "p"))
    b = Local(0.0, "b_i, integral part of b", shape=("p", "n"))
    phi = Local(0.0, "wavelets at X", shape="n_nodes")
    errors = Local(0.0, "|e|^2 of the last samples", shape=5)
    count = Local(0.0, "number of nodes")
    sample = Local(0.0, "number of samples so far")

    def step(self, t: float, h: float) -> None:
        surface(self, h)
        hidden_layer(self)
        control(self, h)
        adapt_nodes(self, h)
        grow(self)
        prune(self)
        self.nodes = self.count
        self.sample += 1.0

    @classmethod
    def design(cls, p: int, n_nodes: int = 40, **values: Any) -> SCWNN:
        """Make the controller of p displacements with at most n_nodes nodes."""
        return cls(p=p, n=2 * p, n_nodes=n_nodes, **values)


def surface(self: Any, T: float) -> None:
    """Write X, int e and s at the sample."""
    p = self.x.shape[0]
    for j in range(p):
        self.X[j], self.X[p + j] = self.x[j], self.v[j]
        self.integral[j] += T * self.x[j]
        self.s[j] = self.v[j] + self.k1 * self.x[j] + self.k2 * self.integral[j]  # (3.6)


def node_count(self: Any) -> int:
    """Return the number of nodes; a restored state cannot make it exceed the arrays."""
    most: int = self.phi.shape[0]
    return min(max(int(self.count), 1), most)


def distance2(self: Any, i: int) -> float:
    """Return the squared distance of X from the centre of node i."""
    total = 0.0
    for m in range(self.X.shape[0]):
        gap = self.X[m] - self.c[i, m]
        total += gap * gap
    return total


def squared_zeta(self: Any, i: int) -> float:
    """Return zeta^2 of node i at X, as in (3.14)."""
    total = 0.0
    for m in range(self.X.shape[0]):
        zeta = (self.X[m] - self.c[i, m]) / self.sigma[i, m]
        total += zeta * zeta
    return total


def hidden_layer(self: Any) -> None:
    """Write the wavelets at X (3.14); the first sample makes the first two nodes."""
    if self.sample == 0.0:
        self.count = 2.0
        for m in range(self.X.shape[0]):
            self.c[1, m] = self.X[m]
            self.sigma[0, m] = self.sigma[1, m] = 1.0
    for i in range(node_count(self)):
        zeta2 = squared_zeta(self, i)
        self.phi[i] = _MEXICAN_HAT * (1.0 - zeta2) * exp(-0.5 * zeta2)


def control(self: Any, T: float) -> None:
    """Adapt the weights (3.45) to (3.47) and r (3.60); write the force (3.8) with (3.63)."""
    p, n, nodes = self.x.shape[0], self.X.shape[0], node_count(self)
    for j in range(p):
        s, u = self.s[j], self.u[j] / self.u_max
        phi2, f, g = 0.0, 0.0, 0.0
        for i in range(nodes):
            phi = self.phi[i]
            self.w[i, j] += T * s * phi
            self.theta[i, j] += T * s * u * phi
            f += self.eta_iw * self.w[i, j] * phi
            g += self.eta_it * self.theta[i, j] * phi
            phi2 += phi * phi
        X2 = 0.0
        for m in range(n):
            self.b[j, m] += T * s * self.X[m]
            f += self.eta_ib * self.b[j, m] * self.X[m]
            X2 += self.X[m] * self.X[m]
        f_p = s * (self.eta_pw * phi2 + self.eta_pb * X2)  # proportional parts of f and g
        g_p = self.eta_pt * s * u * phi2
        mu = membership(s / self.s_max)
        self.r[j] -= T * (self.eta_r * s * mu + self.leak * self.r[j])  # (3.60)
        u_a = f_p + g_p * u + self.r[j] * mu  # (3.51), (3.56)
        self.f[j] = f + f_p
        g = max(g + g_p, self.g_min)
        force = (-self.f[j] - self.k1 * self.v[j] - self.k2 * self.x[j] + u_a) / g
        self.u[j] = self.u_max * min(1.0, max(-1.0, force))


def membership(s: float) -> float:
    """Return mu_sum (3.53) of seven equal triangles over [-1, 1].

    Two neighbours overlap at any s and their sum is one, so mu_sum interpolates the weights
    -1, -2/3, ..., 1 at their peaks: mu_sum = s between the outermost peaks.
    """
    return min(1.0, max(-1.0, s))


def adapt_nodes(self: Any, T: float) -> None:
    """Adapt centres and widths, (3.48) and (3.49), with the force that is held over the next step.

    d phi/d zeta^2 = hat exp(-zeta^2/2) (zeta^2 - 3)/2, and zeta^2 = sum ((X - c)/sigma)^2.
    """
    p, n = self.x.shape[0], self.X.shape[0]
    for i in range(node_count(self)):
        pull = 0.0
        for j in range(p):
            s, u = self.s[j], self.u[j] / self.u_max
            w = self.eta_pw * s * self.phi[i] + self.eta_iw * self.w[i, j]
            theta = self.eta_pt * s * u * self.phi[i] + self.eta_it * self.theta[i, j]
            pull += s * (w + u * theta)
        zeta2 = squared_zeta(self, i)
        slope = _MEXICAN_HAT * exp(-0.5 * zeta2) * 0.5 * (zeta2 - 3.0)
        for m in range(n):
            gap = self.X[m] - self.c[i, m]
            width = self.sigma[i, m]
            self.sigma[i, m] += T * self.eta_sigma * pull * slope * -2.0 * gap * gap / (width * width * width)
            self.c[i, m] += T * self.eta_c * pull * slope * -2.0 * gap / (width * width)
            if self.sigma[i, m] < 1e-3:
                self.sigma[i, m] = 1e-3


def grow(self: Any) -> None:
    """Add a node at X if it is far from all others while the error is large, (3.34) to (3.39)."""
    p, n, nodes = self.x.shape[0], self.X.shape[0], node_count(self)
    error2 = 0.0
    for j in range(p):
        error2 += self.x[j] * self.x[j]
    m = self.errors.shape[0]
    self.errors[int(self.sample) % m] = error2
    total = 0.0
    for k in range(m):
        total += self.errors[k] / (m * m)
    nearest = distance2(self, 0)
    for i in range(1, nodes):
        nearest = min(nearest, distance2(self, i))
    d = sqrt(nearest)
    E1 = max(self.e_max * self.beta**self.sample, self.e_min)
    E2 = max(self.d_max * self.gamma**self.sample, self.d_min)
    if d <= E1 or sqrt(total) <= E2:
        return
    if nodes == self.c.shape[0]:
        self.full += 1.0
        return
    for k in range(n):
        self.c[nodes, k] = self.X[k]
        self.sigma[nodes, k] = self.rho * d
    for j in range(p):
        self.w[nodes, j] = self.x[j] / self.eta_iw if self.eta_iw > 0.0 else 0.0
        self.theta[nodes, j] = 0.0
    self.phi[nodes] = _MEXICAN_HAT
    self.count += 1.0


def prune(self: Any) -> None:
    """Drop the weakest node by (3.40); the last node takes its place."""
    p, n, nodes = self.x.shape[0], self.X.shape[0], node_count(self)
    if nodes < 2:
        return
    weakest, strongest = 0, 0
    for i in range(1, nodes):
        if abs(self.phi[i]) < abs(self.phi[weakest]):
            weakest = i
        if abs(self.phi[i]) > abs(self.phi[strongest]):
            strongest = i
    if abs(self.phi[weakest]) >= self.E3 * abs(self.phi[strongest]):
        return
    last = nodes - 1
    self.phi[weakest] = self.phi[last]
    for m in range(n):
        self.c[weakest, m] = self.c[last, m]
        self.sigma[weakest, m] = self.sigma[last, m]
    for j in range(p):
        self.w[weakest, j] = self.w[last, j]
        self.theta[weakest, j] = self.theta[last, j]
    self.count -= 1.0
