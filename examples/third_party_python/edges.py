# SPDX-License-Identifier: Apache-2.0
"""An annotator in Python; see README.md."""
import numpy as np

from diorama.plugins import Annotator, param


class Edges(Annotator):
    """Where one object ends in front of another thing: 1 on pixels in front of a step, else 0."""

    needs = ["instance_id", "distance_to_image_plane"]
    provides = ["edges"]
    step_m = param(0.02, "Least difference in depth to the next pixel.", unit="m", least=0.0)

    def annotate(self, frame, rng):
        ids = frame.channels["instance_id"]
        depth = np.minimum(frame.channels["distance_to_image_plane"], frame.camera.far_m)
        edges = np.zeros(ids.shape, np.uint32)
        for axis in (0, 1):
            near, far = [slice(None)] * 2, [slice(None)] * 2
            near[axis], far[axis] = slice(None, -1), slice(1, None)
            near, far = tuple(near), tuple(far)
            other = ids[near] != ids[far]
            step = depth[far] - depth[near]
            edges[near] |= other & (step > self.step_m)
            edges[far] |= other & (-step > self.step_m)
        return {"edges": edges}
