"""An arm that follows what its controller aims at, and looks for jumps of the aim."""

import math

# Of the first order. [s]
LAG = 0.015
# More than any joint's acceleration: what the velocity changes beyond it is a jump. [rad/s²]
MOST = 10.0


class Arm:
    """Joints where they are measured, the aim before, and what was seen."""

    def __init__(self, start):
        self.measured, self.speed = list(start), [0.0] * len(start)
        self.elapsed = 0.0
        self.seen = {"messages": 0, "goals": 0, "late": 0, "dropped": 0, "lost": 0, "step": 0.0,
                     "velocity_step": 0.0, "largest_error": 0.0}
        self.stand()

    def stand(self):
        """What comes next is aimed at from where it is measured."""
        self.last = (list(self.measured), [0.0] * len(self.measured))

    def rest(self):
        """It does not move."""
        self.speed = [0.0] * len(self.measured)

    def judge(self, q, v, elapsed):
        """What is aimed at `elapsed` after the last: steps beyond what the velocity explains, and of
        the velocity itself, are kept. Between two looks the velocity may have been higher than at both,
        by what that acceleration makes of half the time: 10 µrad in a cycle of 2 ms."""
        for j in range(len(q)):
            way = abs(q[j] - self.last[0][j])
            most = max(abs(v[j]), abs(self.last[1][j])) * elapsed + MOST * elapsed**2 / 4
            self.seen["step"] = max(self.seen["step"], way - most)
            change = abs(v[j] - self.last[1][j]) - MOST * elapsed
            self.seen["velocity_step"] = max(self.seen["velocity_step"], change)
        self.last = (q, v)

    def follow(self, q, v):
        """One cycle, `elapsed` long, behind what is aimed at."""
        for j in range(len(q)):
            error = abs(q[j] - self.measured[j])
            self.seen["largest_error"] = max(self.seen["largest_error"], error)
        share = 1.0 - math.exp(-self.elapsed / LAG)
        for j in range(len(q)):
            before = self.measured[j]
            self.measured[j] += share * (q[j] + LAG * v[j] - self.measured[j])
            self.speed[j] = (self.measured[j] - before) / self.elapsed
