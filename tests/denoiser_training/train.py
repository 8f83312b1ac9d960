#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the denoiser's network on films that denoiser_pictures rendered; see README.md."""
import argparse
import math
import pathlib
import random
import struct
import threading
import time

import numpy as np
import torch
import torch.nn.functional as F

from network import CHANNELS, Film, Network, denoised

MAGIC = 0x4D4C4946  # "FILM"
CROP = 192
EPSILON = 0.1  # of the relative error; 0.18 is middle grey
SLACK = 1.5  # relative errors beyond count less: chance finds in what is compared with
# How often which number of paths is drawn.
SHARES = {1: 0.12, 2: 0.26, 4: 0.24, 16: 0.2, 64: 0.12, 256: 0.5}
SIZES = {
    "base": dict(widths=(48, 64, 80, 80, 64), encoder=(2, 2, 2, 2, 2), decoder=(2, 2, 2, 2)),
    "mid": dict(widths=(32, 64, 80, 80, 64), encoder=(2, 2, 2, 2, 2), decoder=(2, 2, 2, 2)),
    "small": dict(widths=(16, 32, 48, 48, 48), encoder=(2, 2, 2, 1, 1), decoder=(1, 1, 1, 1)),
    "wide_small": dict(widths=(32, 32, 48, 48, 48), encoder=(1, 2, 2, 1, 1), decoder=(0, 1, 1, 1)),
}


def read_films(path):
    """-> values [films, CHANNELS, height, width] in half precision, paths, real time, exposures."""
    data = path.read_bytes()
    magic, width, height, count, channels = struct.unpack_from("<5i", data)
    if magic != MAGIC or channels != CHANNELS:
        raise ValueError(f"{path}: not a file of films")
    size = channels * width * height
    values, paths, exposures = [], [], []
    offset = 20
    for _ in range(count):
        samples, _, exposure = struct.unpack_from("<2if", data, offset)
        values.append(np.frombuffer(data, "<f2", size, offset + 12))
        paths.append(samples)
        exposures.append(exposure)
        offset += 12 + 2 * size
    return np.stack(values).reshape(count, channels, height, width), paths, exposures


class Pictures:
    """Views in the device's memory; further ones come in while training runs."""

    def __init__(self, folder, device, most):
        self.folder, self.device, self.most = pathlib.Path(folder), device, most
        self.views, self.names = [], set()
        self.is_done = False

    def look(self):
        for path in sorted(self.folder.glob("*.films")):
            if path.name in self.names or len(self.views) >= self.most:
                continue
            self.names.add(path.name)
            values, paths, exposures = read_films(path)
            self.views.append((torch.from_numpy(values).to(self.device), paths, exposures))

    def keep_looking(self):
        while not self.is_done:
            self.look()
            time.sleep(2.0)

    def batch(self, size, chance, most_paths):
        inputs, targets, counts, exposures = [], [], [], []
        views = self.views
        while len(inputs) < size:
            values, paths, own_exposures = views[chance.randrange(len(views))]
            usable = [i for i in range(len(paths) - 1) if paths[i] <= most_paths]
            weights = [SHARES.get(paths[i], 0.1) for i in usable]
            film = chance.choices(usable, weights)[0]
            height, width = values.shape[2:]
            y = chance.randrange(height - CROP + 1)
            x = chance.randrange(width - CROP + 1)
            window = values[:, :, y : y + CROP, x : x + CROP]
            raw = window[film].float()
            last = window[-1, 0:3].float() + window[-1, 3:6].float()
            if film == len(paths) - 2:
                target = last
            else:
                target = 0.5 * (last + window[-2, 0:3].float() + window[-2, 3:6].float())
            inputs.append(raw)
            targets.append(target)
            counts.append(float(paths[film]))
            exposures.append(own_exposures[film])
        inputs, targets = torch.stack(inputs), torch.stack(targets)
        counts = torch.tensor(counts, device=self.device)
        exposures = torch.tensor(exposures, device=self.device)
        return varied(inputs, targets, exposures, counts, chance)


def varied(inputs, targets, exposures, counts, chance):
    """Mirrored and turned pictures, other axes for the normals, other colours, other exposures."""
    for axis in (2, 3):
        if chance.random() < 0.5:
            inputs, targets = inputs.flip(axis), targets.flip(axis)
    if chance.random() < 0.5:
        inputs, targets = inputs.transpose(2, 3), targets.transpose(2, 3)
    colors = chance.sample(range(3), 3) if chance.random() < 0.3 else list(range(3))
    axes = chance.sample(range(3), 3)
    order = [*colors, *(3 + c for c in colors), *(6 + c for c in colors), *(9 + a for a in axes)]
    inputs = inputs[:, order + list(range(12, CHANNELS))].contiguous()
    signs = torch.tensor([chance.choice((-1.0, 1.0)) for _ in range(3)], device=inputs.device)
    inputs[:, 9:12] *= signs.view(1, 3, 1, 1)
    factor = torch.tensor(
        [2.0 ** chance.gauss(0.0, 0.4) for _ in range(len(inputs))], device=inputs.device
    )
    return inputs, targets[:, colors], counts, exposures * factor, factor


def loss_of(output, target):
    """Relative squared error, by what the network itself thinks of the brightness: unbiased for
    targets that have noise. Beyond SLACK it grows linearly."""
    with torch.no_grad():
        grey = F.avg_pool2d(output.mean(1, keepdim=True), 3, 1, 1, count_include_pad=False)
        scale = 1.0 / (0.5 * (grey + output) + EPSILON).clamp(min=EPSILON)
    error = (output - target) * scale
    size = error.abs()
    return torch.where(size < SLACK, error * error, SLACK * (2.0 * size - SLACK)).mean()


def train(options):
    device = torch.device(options.device)
    torch.manual_seed(options.seed)
    chance = random.Random(options.seed)
    if device.type == "cuda":
        torch.backends.cudnn.benchmark = True
        torch.backends.cuda.matmul.allow_tf32 = True
        torch.backends.cudnn.allow_tf32 = True
    pictures = Pictures(options.pictures, device, options.most_views)
    while len(pictures.views) < options.first_views:
        pictures.look()
        time.sleep(0.5)
    threading.Thread(target=pictures.keep_looking, daemon=True).start()
    network = Network(**SIZES[options.size]).to(device)
    if device.type == "cuda":
        network = network.to(memory_format=torch.channels_last)
    average = [p.detach().clone() for p in network.parameters()]
    optimizer = torch.optim.Adam(network.parameters(), lr=options.rate, betas=(0.9, 0.99))
    start = time.time()
    step, losses = 0, []
    told = start
    while True:
        part = (time.time() - start) / options.seconds
        if part >= 1.0 or step >= options.steps:
            break
        rate = options.rate * max(0.01, 0.5 + 0.5 * math.cos(math.pi * part))
        for group in optimizer.param_groups:
            group["lr"] = rate * min(1.0, (step + 1) / 200)
        inputs, targets, counts, exposures, factor = pictures.batch(
            options.batch, chance, options.most_paths
        )
        with torch.no_grad():
            film = Film(inputs, counts, exposures)
        with torch.autocast(device.type, torch.bfloat16, enabled=device.type == "cuda"):
            logits = network(film.features)
        output = denoised(film, logits)
        scale = factor.view(-1, 1, 1, 1)
        loss = loss_of(output * scale, targets * scale)
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        step += 1
        keep = min(0.999, step / (step + 10.0))
        with torch.no_grad():
            torch._foreach_mul_(average, keep)
            torch._foreach_add_(average, list(network.parameters()), alpha=1.0 - keep)
        if step % 20 == 0:
            losses.append(float(loss.detach()))
        if time.time() - told > options.tell:
            told = time.time()
            seconds = told - start
            print(
                f"{options.size} {seconds:.0f} s, step {step}, {len(pictures.views)} views, "
                f"loss {np.mean(losses[-200:]):.4f}",
                flush=True,
            )
            save(network, average, options)
    pictures.is_done = True
    save(network, average, options)
    print(f"{options.size}: {step} steps, {len(pictures.views)} views", flush=True)


def save(network, average, options):
    own = [p.detach().clone() for p in network.parameters()]
    with torch.no_grad():
        for p, mean in zip(network.parameters(), average):
            p.copy_(mean)
        part = pathlib.Path(str(options.out) + ".part")
        network.save(part)
        part.rename(options.out)
        for p, value in zip(network.parameters(), own):
            p.copy_(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", help="folder that denoiser_pictures writes to, or has written")
    parser.add_argument("out", type=pathlib.Path, help="the weights")
    parser.add_argument("--size", choices=SIZES, default="base")
    parser.add_argument("--seconds", type=float, default=900.0)
    parser.add_argument("--steps", type=int, default=10**9)
    parser.add_argument("--batch", type=int, default=24)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first-views", type=int, default=100, help="training begins with so many")
    parser.add_argument("--most-views", type=int, default=4000)
    parser.add_argument("--most-paths", type=int, default=256)
    parser.add_argument("--tell", type=float, default=30.0, help="seconds between lines")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    train(parser.parse_args())


if __name__ == "__main__":
    main()
