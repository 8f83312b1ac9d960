# SPDX-License-Identifier: Apache-2.0
# The cells of tour.ipynb; make_notebook.py runs them.
# %% [markdown]
# # A tour of the Python package
#
# On the dataset that `./bootstrap.sh demo` leaves: 12 captures of a dining room by 2 cameras each. `make_notebook.py` beside this
# notebook ran it, from the folder that holds `_out_dining_room`.
# %%
import matplotlib.pyplot as plt
import numpy as np

import diorama

dataset = diorama.open("_out_dining_room/basic")
dataset
# %% [markdown]
# What it holds: names of channels and of labels. What is not in this list is `None` or not there.
# %%
print(*dataset.holds, sep=", ")
# %%
capture = dataset[6]
frame = capture.frames[0]
print(f"capture {capture.index}, {frame.camera_name}: {len(frame.instances)} labelled objects")
for name, channel in frame.channels.items():
    print(f"{name:24} {channel.dtype!s:8} {channel.shape}  can be written to: {channel.flags.writeable}")
# %% [markdown]
# ## Colour, boxes, ids, depth
# Channels are numpy arrays that view what the reader decoded. An instance's `id` is its value in `instance_id`.
# %%
visible = [instance for instance in frame.instances if instance.box and "class" in instance.labels]
colors = plt.cm.tab20(np.arange(20))
figure, axes = plt.subplots(1, 3, figsize=(13, 3.4))
axes[0].imshow(frame.channels["color"])
for instance in visible:
    x_min, y_min, x_max, y_max = instance.box
    axes[0].add_patch(plt.Rectangle((x_min, y_min), x_max - x_min, y_max - y_min, fill=False, color="yellow"))
    axes[0].text(x_min, y_min - 4, instance.labels["class"], color="yellow", fontsize=7)
painted = np.zeros((*frame.channels["instance_id"].shape, 4))
for i, instance in enumerate(visible):
    painted[frame.mask(instance)] = colors[i % 20]
axes[1].imshow(painted)
depth = axes[2].imshow(frame.channels["distance_to_image_plane"], vmax=4.0, cmap="viridis")
figure.colorbar(depth, label="m")
for axis, title in zip(axes, ("color, boxes", "instance_id", "distance_to_image_plane")):
    axis.set_title(title)
    axis.axis("off")
figure.tight_layout()
# %% [markdown]
# ## From pixels to the world
# Depth, the camera's matrix and its pose give the point of every pixel in the world, in metres with z up. The camera looks along -z
# with y up, so y and z turn their sign. Here from above: in the colours of the picture, and the objects in those of their ids.
# %%
y, x = np.mgrid[0:frame.camera.height:2, 0:frame.camera.width:2]
distance = frame.channels["distance_to_image_plane"][::2, ::2]
seen = np.isfinite(distance)
rays = np.linalg.inv(frame.camera.matrix) @ np.stack([x + 0.5, y + 0.5, np.ones_like(x)])[:, seen]
points = frame.world_from_camera[:3, :3] @ (rays * distance[seen] * [[1], [-1], [-1]]) + frame.world_from_camera[:3, 3:]
order = np.argsort(points[2])
figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharex=True, sharey=True)
axes[0].scatter(*points[:2, order], c=(frame.channels["color"][::2, ::2, :3][seen] / 255)[order], s=1)
is_object = painted[::2, ::2][seen][:, 3] > 0
axes[1].scatter(*points[:2, is_object], c=painted[::2, ::2][seen][is_object], s=1)
for axis in axes:
    axis.set_aspect("equal")
    axis.set_xlabel("x, m")
axes[0].set_ylabel("y, m");
# %% [markdown]
# ## What is in it
# Only labels are read here, no pixels.
# %%
counts = {}
for capture in diorama.open("_out_dining_room/basic", wanted=["instances", "labels", "tight_boxes"]):
    for each in capture.frames:
        for instance in each.instances:
            if instance.box and "class" in instance.labels:
                label = instance.labels["class"]
                counts[label] = counts.get(label, 0) + 1
labels = sorted(counts, key=counts.get)
plt.figure(figsize=(10, 2.6))
plt.bar(labels, [counts[label] for label in labels])
plt.xticks(rotation=60, ha="right", fontsize=7)
plt.ylabel("boxes in 24 pictures")
plt.tight_layout()
# %% [markdown]
# ## For other tools
# %%
coco = dataset.to_coco()
print({key: len(entries) for key, entries in coco.items()})
first = coco["annotations"][0]
print(first["bbox"], first["area"], coco["categories"][first["category_id"] - 1])
# %% [markdown]
# ## Without a disk
# `diorama.run()` makes a job's captures and hands them to a function. Here the first eight frames of a clip, small, and the exact flow
# from the seventh to the eighth; returning `False` ends the run.
# %%
clip = []


def take(capture):
    clip.append(capture)
    return len(clip) < 8


diorama.run("configs/clip.yaml", take, wanted=["color", "flow_forward", "flow_forward_state", "instances"],
            settings={"cameras[0].width": 160, "cameras[0].height": 120, "renderer.samples": 4})
shot = clip[6]
flow = shot.frames[0].channels["flow_forward"]
state = shot.frames[0].channels["flow_forward_state"]
print(shot.clip, f"at {shot.clip.time_s:.3f} s")
fastest = max((i for i in shot.frames[0].instances if i.velocity), key=lambda i: np.linalg.norm(i.velocity.linear))
print(f"{fastest.labels['class']} falls with {-fastest.velocity.linear[2]:.2f} m/s")
figure, axes = plt.subplots(1, 3, figsize=(13, 3.2))
axes[0].imshow(shot.frames[0].channels["color"])
axes[0].quiver(*np.mgrid[4:160:8, 4:120:8], *flow[4::8, 4::8].transpose(2, 1, 0),
               angles="xy", scale_units="xy", scale=0.3, color="yellow")
axes[0].set_title("color, flow to the next frame")
axes[1].imshow(np.linalg.norm(flow, axis=2), cmap="magma")
axes[1].set_title("its length, pixels")
color_of = {diorama.FlowState.HIDDEN: [200, 30, 30], diorama.FlowState.OUTSIDE: [240, 160, 0],
            diorama.FlowState.UNKNOWN: [0, 0, 0]}
shown = np.full((*state.shape, 3), 225, np.uint8)
for value, color in color_of.items():
    shown[state == value] = color
axes[2].imshow(shown)
axes[2].set_title("red: hidden in the next frame, orange: outside")
for axis in axes:
    axis.axis("off")
figure.tight_layout()
