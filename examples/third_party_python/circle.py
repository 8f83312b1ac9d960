# SPDX-License-Identifier: Apache-2.0
"""A randomizer in Python; see README.md."""
import math

from diorama.plugins import Randomizer, param


class Circle(Randomizer):
    """Sets objects onto a circle, each turned about the vertical."""

    nodes = param("/Assets/*", "Objects to set down.")
    radius_m = param(0.5, "Of the circle, round the working area.", unit="m", least=0.0, most=100.0)
    height_m = param(0.0, "Above the working area.", unit="m")
    jitter_m = param(0.0, "Standard deviation of the radius.", unit="m", least=0.0)

    def randomize(self, scene, context, rng):
        nodes = scene.match(self.nodes)
        for i, node in enumerate(nodes):
            own = rng.fork(node.path)  # one more object leaves the draws of the others as they were
            radius = self.radius_m + own.normal(0.0, self.jitter_m)
            angle = 2.0 * math.pi * (i + own.uniform()) / len(nodes)
            node.position = context.working_area + [radius * math.cos(angle), radius * math.sin(angle), self.height_m]
