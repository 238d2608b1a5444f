r"""The leg that a noisy output is on: the motion since its last turning point, and when it has ended.

Symbols: ``T`` output that the memory of the sensor does not explain [1]; ``d`` +1 or -1, the direction of motion; ``v``
variance of the smoothed output [1]; ``M`` delay of the smoothing [samples].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from .smooth import Smoothed

AHEAD, BACK = 3.0, 4.0  # standard deviations that tell motion from noise, onward and backward
TREND = 2.5  # the same for the slope


@dataclass(frozen=True, slots=True)
class Leg:
    """Motion of the output since the last turning point, counted from the output of the memory.

    Attributes
    ----------
    direction : casadi.MX, scalar
        +1 for rising, -1 for falling.
    extreme, variance : casadi.MX, scalar
        How far the leg has come [1] and the variance of its error [1].
    start_variance : casadi.MX, scalar
        Variance [1] of the turning point at which the leg began.
    advancing : casadi.MX, scalar
        1 while the leg runs on, 0 once it rests.
    """

    direction: ca.MX
    extreme: ca.MX
    variance: ca.MX
    start_variance: ca.MX
    advancing: ca.MX

    def follow(self, output: Smoothed, held: ca.MX, M: int) -> tuple[Leg, ca.MX, ca.MX]:
        """Follow the output by one sample.

        Parameters
        ----------
        output : Smoothed
            Smoothed output of the sample.
        held : casadi.MX, scalar
            Output of the memory [1] if the strain rests.
        M : int
            Delay of the smoothing [samples], over which errors are correlated.

        Returns
        -------
        leg : Leg
            With the new sample.
        turned : casadi.MX, scalar
            Whether the leg has ended.
        certain : casadi.MX, scalar
            Change of output [1] that will not be taken back: the turning point, or all but the noise.
        """
        d, v = self.direction, output.variance
        T, T_turn = output.value - held, output.turn - held
        width = ca.sqrt(v + self.variance)
        turned = (T - self.extreme) * d < -BACK * width
        onward = (T_turn - self.extreme) * d > 0.0
        moving = ca.logic_or(output.trend * d > TREND, (T - self.extreme) * d > AHEAD * width)
        advancing = ca.logic_or(moving, ca.logic_and(self.advancing, onward))
        resting = ca.logic_and(ca.fabs(output.trend) < TREND, ca.logic_not(advancing))
        gain = ca.if_else(resting, self.variance / (self.variance + M * v), 0.0)  # errors last for about M samples
        followed = ca.if_else(advancing, T_turn, self.extreme + gain * (T - self.extreme))
        extreme = ca.if_else(turned, self.extreme + d * ca.fmax((T_turn - self.extreme) * d, 0.0), followed)
        variance = ca.if_else(advancing, v, (1.0 - gain) * self.variance)
        certain = ca.if_else(turned, extreme, d * ca.fmax(extreme * d - BACK * width, 0.0))
        return replace(self, extreme=extreme, variance=variance, advancing=advancing), turned, certain

    def recount(self, turned: ca.MX, known: ca.MX, T: ca.MX, v: ca.MX, moved: ca.MX) -> Leg:
        """Count from a memory whose output has ``moved`` [1]; begin anew at a turning point or a known strain."""
        restart = ca.logic_or(turned, known)
        return replace(
            self,
            direction=ca.if_else(turned, -self.direction, self.direction),
            extreme=ca.if_else(restart, T, self.extreme - moved),
            variance=ca.if_else(restart, v, self.variance),
            start_variance=ca.if_else(turned, self.variance, self.start_variance),
        )
