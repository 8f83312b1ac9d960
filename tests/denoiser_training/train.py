#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the denoiser's network on films that denoiser_pictures rendered; see README.md."""
import argparse
import contextlib
import math
import os
import pathlib
import struct
import threading
import time
import zlib

import numpy as np
import torch
import torch.distributed as dist
import torch.nn.functional as F

from network import CHANNELS, Film, Network, denoised, luminance

MAGIC = 0x4D4C4946  # "FILM"
CROP = 192
EPSILON = 0.1  # of the relative error; 0.18 is middle grey
SLACK = 4.0  # relative errors beyond count less: chance finds in what is compared with,
SEEN_SLACK = 0.5  # and of what is seen: by the slope in the dark a lamp would be a thousand whites
POOLS = ((4, 1.0), (16, 1.0))  # blocks of pixels whose means are compared, too, and how much they count
EDGES_COUNT = 48.0  # by what is seen of errors
REACH = 4  # pixels over which light of chance finds is spread
KEPT = 0.9995  # of the average of weights, per step
MOST_NORM = 20.0  # of a gradient, in usual ones
# How often which number of paths is drawn, where a view has it.
SHARES = {1: 0.08, 2: 0.26, 4: 0.24, 16: 0.22, 64: 1.0, 256: 2.0}
OTHER_SHARE = 0.12
FILMS_PER_VIEW = 7.3  # that are kept, on average ...
MOST_FILMS = 8  # ... and at most
SIZE = dict(widths=(80, 64, 80, 80, 64), encoder=(2, 2, 2, 2, 2), decoder=(2, 2, 2, 2))


def read_films(path):
    """-> values [films, CHANNELS, height, width] in half precision, paths that were asked for,
    paths with those that learn, exposures."""
    data = path.read_bytes()
    magic, width, height, count, channels = struct.unpack_from("<5i", data)
    if magic != MAGIC or channels != CHANNELS:
        raise ValueError(f"{path}: not a file of films")
    size = channels * width * height
    values, paths, counted, exposures = [], [], [], []
    offset = 20
    for _ in range(count):
        samples, all_samples, exposure = struct.unpack_from("<2if", data, offset)
        values.append(np.frombuffer(data, "<f2", size, offset + 12))
        paths.append(samples)
        counted.append(all_samples)
        exposures.append(exposure)
        offset += 12 + 2 * size
    return np.stack(values).reshape(count, channels, height, width), paths, counted, exposures


def edges_of(raw):
    """Pixels whose neighbours show other surfaces."""

    def span(values):
        return F.max_pool2d(values, 3, 1, 1) + F.max_pool2d(-values, 3, 1, 1)

    distance = torch.log(raw[:, 12:13] + 0.05)
    is_edge = (span(distance) > 0.1) | (span(raw[:, 15:16]) > 0.1)
    is_edge |= (span(raw[:, 9:12]) > 0.4).any(1, keepdim=True)
    is_edge |= (span(raw[:, 6:9]) > 0.25).any(1, keepdim=True)
    return is_edge


def spread(raw, paths):
    """Light of films, to compare with: what a pixel's brightest path brings beyond half of what the
    paths around bring goes to pixels around of the same kind, none is lost."""
    scattered, normal = raw[:, 3:6], raw[:, 9:12]
    albedo = luminance(raw[:, 6:9]).clamp(min=0.02)
    distance = torch.log(raw[:, 12:13] + 0.05)
    own = luminance(scattered)
    brought = torch.minimum(own, raw[:, 14:15] / paths.view(-1, 1, 1, 1))
    around = F.avg_pool2d((own - brought) / albedo, 7, 1, 3, count_include_pad=False)
    excess = (brought - 0.5 * around * albedo).clamp(min=0.0)
    taken = scattered * (excess / own.clamp(min=1e-12))
    height, width = own.shape[2:]
    pad = (REACH,) * 4
    guides = F.pad(torch.cat([normal, distance], 1), pad, value=100.0)

    def around_sum(values):
        """Of the pixels around by how much they are of one kind, which is the same both ways."""
        padded, total = F.pad(values, pad), torch.zeros_like(values)
        for dy in range(2 * REACH + 1):
            for dx in range(2 * REACH + 1):
                there = slice(dy, dy + height), slice(dx, dx + width)
                other = guides[:, :, there[0], there[1]]
                away = (dx - REACH) ** 2 + (dy - REACH) ** 2
                unlike = 4.0 * ((other[:, :3] - normal) ** 2).sum(1, keepdim=True)
                unlike = unlike + 20.0 * (other[:, 3:] - distance).abs() + away / (REACH * REACH)
                total = total + torch.exp(-unlike) * padded[:, :, there[0], there[1]]
        return total

    given = albedo * around_sum(taken / around_sum(albedo))
    return raw[:, 0:3] + scattered - taken + given


class Group:
    """The processes that train together, one a GPU, begun by torchrun; or this one alone. Each has
    views of its own; their gradients are averaged, so that all have the same weights."""

    def __init__(self):
        self.rank = int(os.environ.get("RANK", 0))
        self.size = int(os.environ.get("WORLD_SIZE", 1))
        if self.size > 1:
            dist.init_process_group("nccl" if torch.cuda.is_available() else "gloo")

    def average(self, values):
        if self.size > 1:
            dist.all_reduce(values)
            values.div_(self.size)

    def told(self, numbers, device):
        """What the first process says."""
        if self.size == 1:
            return numbers
        values = torch.tensor(numbers, dtype=torch.float64, device=device)
        dist.broadcast(values, 0)
        return values.tolist()


class Pictures:
    """Views in the device's memory; further ones come in while training runs."""

    def __init__(self, folder, device, most, group):
        self.folder, self.device, self.most = pathlib.Path(folder), device, most
        self.group = group
        self.names = set()
        # [(number of the film, paths asked for, all, exposure, its target's other half is apart)]
        self.views = []
        self.films = self.targets = None
        self.film_count = 0
        self.is_done = False
        self.lock = threading.Lock()  # nothing is loaded while work is recorded

    def look(self):
        for path in sorted(self.folder.glob("*.films")):
            if path.name in self.names or self.is_full() or self.is_done:
                continue
            if zlib.crc32(path.name.encode()) % self.group.size != self.group.rank:
                continue
            self.names.add(path.name)
            try:
                films = read_films(path)
            except (ValueError, struct.error) as error:
                print(f"{path}: {error}", flush=True)
                continue
            with self.lock:
                self.add(*films)

    def is_full(self):
        if self.films is None:
            return False
        return len(self.views) >= self.most or self.film_count + MOST_FILMS > self.films.shape[0]

    def add(self, values, paths, counted, exposures):
        count, _, height, width = values.shape
        if self.films is None:
            self.height, self.width = height, width
            size = height * width
            room = int(FILMS_PER_VIEW * self.most) + MOST_FILMS
            self.films = torch.zeros(
                (room, CHANNELS, size), dtype=torch.float16, device=self.device
            )
            self.targets = torch.zeros(
                (self.most, 7, size), dtype=torch.float16, device=self.device
            )
        if (height, width) != (self.height, self.width):
            raise ValueError("films of different sizes")
        raw = torch.from_numpy(values).to(self.device)
        view = len(self.views)
        first = self.film_count
        self.films[first : first + count - 1] = raw[:-1].flatten(2)
        pair = raw[-2:].float()
        counts = torch.tensor(paths[-2:], dtype=torch.float32, device=self.device)
        self.targets[view, 0:6] = spread(pair, counts).clamp(max=65000.0).reshape(6, -1).half()
        self.targets[view, 6:7] = edges_of(pair[1:2]).reshape(1, -1).half()
        self.film_count += count - 1
        self.views.append(
            [(first + i, paths[i], counted[i], exposures[i], i == count - 2)
             for i in range(count - 1)]
        )

    def keep_looking(self):
        while not self.is_done:
            self.look()
            time.sleep(1.0)


class Batch:
    """Which windows are taken and how they are varied: mirrored and turned pictures, other axes for
    the normals, other colours, other exposures. Drawn here, made on the device."""

    LONGS = 2 + CHANNELS + 7 + 5
    FLOATS = 3 + 3 + 2

    def __init__(self, pictures, size, chance):
        self.pictures, self.size, self.chance = pictures, size, chance
        device = pictures.device
        self.longs = torch.zeros((size, self.LONGS), dtype=torch.int64, device=device)
        self.floats = torch.zeros((size, self.FLOATS), dtype=torch.float32, device=device)
        self.steps = torch.arange(CROP, device=device)

    def draw(self):
        chance, pictures, size = self.chance, self.pictures, self.size
        longs = np.zeros((size, self.LONGS), np.int64)
        floats = np.zeros((size, self.FLOATS), np.float32)
        views = chance.integers(len(pictures.views), size=size)
        for b, view in enumerate(views):
            films = [f for f in pictures.views[view] if f[1] in SHARES or f[4]]
            sums = np.cumsum([SHARES.get(f[1], OTHER_SHARE) for f in films])
            film, _, paths, exposure, is_apart = films[
                int(np.searchsorted(sums, chance.random() * sums[-1]))
            ]
            longs[b, 0] = film
            floats[b, 0:2] = paths, exposure
            floats[b, 6:8] = (0.0, 1.0) if is_apart else (0.5, 0.5)
        longs[:, 1] = views
        colors = np.argsort(chance.random((size, 3)), 1)
        colors[chance.random(size) > 0.3] = np.arange(3)
        axes = np.argsort(chance.random((size, 3)), 1)
        rest = np.broadcast_to(np.arange(12, 16), (size, 4))
        longs[:, 2 : 2 + CHANNELS] = np.hstack(
            [colors, 3 + colors, 6 + colors, 9 + axes, rest, 16 + colors]
        )
        longs[:, 2 + CHANNELS : 9 + CHANNELS] = np.hstack(
            [colors, 3 + colors, np.full((size, 1), 6)]
        )
        longs[:, 9 + CHANNELS] = chance.integers(pictures.height - CROP + 1, size=size)
        longs[:, 10 + CHANNELS] = chance.integers(pictures.width - CROP + 1, size=size)
        longs[:, 11 + CHANNELS :] = chance.integers(0, 2, (size, 3))
        floats[:, 2] = 2.0 ** (0.4 * chance.standard_normal(size))
        floats[:, 3:6] = chance.choice((-1.0, 1.0), (size, 3))
        self.longs.copy_(torch.from_numpy(longs))
        self.floats.copy_(torch.from_numpy(floats))

    def make(self):
        """-> films' channels, paths, exposures, targets, edges, factors"""
        longs, floats, pictures = self.longs, self.floats, self.pictures
        down, across = self.steps.view(1, -1, 1), self.steps.view(1, 1, -1)
        y0, x0, is_down, is_across, is_turned = (
            longs[:, 9 + CHANNELS + k].view(-1, 1, 1) for k in range(5)
        )
        y = down + is_turned * (across - down)
        x = across + is_turned * (down - across)
        y = y0 + y + is_down * (CROP - 1 - 2 * y)
        x = x0 + x + is_across * (CROP - 1 - 2 * x)
        places = (y * pictures.width + x).view(self.size, 1, -1)

        def taken(bank, number, order):
            rows = bank.shape[1]
            chosen = (longs[:, number : number + 1] * rows + order).flatten()
            found = bank.view(-1, bank.shape[2]).index_select(0, chosen)
            found = found.view(self.size, rows, -1)
            found = found.gather(2, places.expand(-1, rows, -1))
            return found.view(self.size, rows, CROP, CROP).float()

        raw = taken(pictures.films, 0, longs[:, 2 : 2 + CHANNELS])
        signs = floats[:, 3:6].view(-1, 3, 1, 1)
        raw = torch.cat([raw[:, :9], raw[:, 9:12] * signs, raw[:, 12:]], 1)
        both = taken(pictures.targets, 1, longs[:, 2 + CHANNELS : 9 + CHANNELS])
        halves = floats[:, 6:8].view(-1, 2, 1, 1)
        target = both[:, 0:3] * halves[:, 0:1] + both[:, 3:6] * halves[:, 1:2]
        return raw, floats[:, 0], floats[:, 1] * floats[:, 2], target, both[:, 6:7], floats[:, 2]


def squared(error, slack):
    size = error.abs()
    return torch.where(size < slack, error * error, slack * (2.0 * size - slack))


def relative_error(output, target, brightness):
    return squared((output - target) / (brightness + EPSILON), SLACK)


def seen_error(output, target, brightness):
    """Of what the view transform (ACES by Narkowicz, gamma 2.2) shows, by its slope where the
    brightness is: straight in the target, so noise in it leaves no bias."""
    x = brightness + 0.01
    over, under = x * (2.51 * x + 0.03), x * (2.43 * x + 0.59) + 0.14
    slope = ((5.02 * x + 0.03) * under - over * (4.86 * x + 0.59)) / (under * under)
    error = (output - target) * slope * (over / under) ** (1.0 / 2.2 - 1.0) / 2.2
    return squared(error, SEEN_SLACK)


def loss_of(output, target, edges):
    """Relative squared error, by what the network itself thinks of the brightness: unbiased for
    targets that have noise. Of pixels, and of blocks of them, whose targets have less; on edges
    of what is seen, too."""
    with torch.no_grad():
        grey = F.avg_pool2d(output.mean(1, keepdim=True), 3, 1, 1, count_include_pad=False)
        brightness = (0.5 * (grey + output)).clamp(min=0.0)
    loss = relative_error(output, target, brightness).mean()
    loss = loss + EDGES_COUNT * (seen_error(output, target, brightness) * edges).mean()
    for side, share in POOLS:
        means, wanted = F.avg_pool2d(output, side), F.avg_pool2d(target, side)
        brightness = means.detach().mean(1, keepdim=True).clamp(min=0.0)
        loss = loss + share * relative_error(means, wanted, brightness).mean()
    return loss


class Trainee:
    """A network with its optimizer (Adam), whose steps can be recorded once and played again."""

    def __init__(self, pictures, options, chance, group):
        self.device = pictures.device
        self.group = group
        begin = options.begin_from
        network = Network.load(begin).grown(**SIZE) if begin else Network(**SIZE)
        self.network = network.to(self.device)
        if self.device.type == "cuda":
            self.network = self.network.to(memory_format=torch.channels_last)
        self.batch = Batch(pictures, options.batch, chance)
        self.parameters = list(self.network.parameters())
        self.sizes = [p.numel() for p in self.parameters]
        flat = torch.cat([p.detach().flatten() for p in self.parameters])
        self.flat, self.mean = flat.clone(), flat.clone()
        self.first, self.second = torch.zeros_like(flat), torch.zeros_like(flat)
        self.norm = torch.zeros((), device=self.device)
        self.loss = torch.zeros((), device=self.device)
        # Rate, its corrections for the first steps, share of the average that is kept.
        self.numbers = torch.zeros(4, device=self.device)
        self.count = 0
        self.found = torch.zeros(flat.numel() + 1, device=self.device)  # gradient, loss
        self.graphs = None  # of look() and of learn()
        self.compiled_loss = self.loss_of_windows
        if options.graphs and self.device.type == "cuda":
            self.compiled_loss = torch.compile(self.loss_of_windows, dynamic=False)
        self.put(self.flat)

    def put(self, flat):
        for p, values in zip(self.parameters, flat.split(self.sizes)):
            p.data.copy_(values.view_as(p))

    def loss_of_windows(self, raw, paths, exposures, target, edges, factor):
        with torch.no_grad():
            film = Film(raw, paths, exposures)
        is_cuda = self.device.type == "cuda"
        with (
            torch.autocast("cuda", torch.bfloat16, cache_enabled=False)
            if is_cuda
            else contextlib.nullcontext()
        ):
            features = film.features
            if is_cuda:
                features = features.contiguous(memory_format=torch.channels_last)
            logits = self.network(features)
        scale = factor.view(-1, 1, 1, 1)
        return loss_of(denoised(film, logits) * scale, target * scale, edges)

    def look(self):
        loss = self.compiled_loss(*self.batch.make())
        gradients = torch.autograd.grad(loss, self.parameters)
        self.found.copy_(torch.cat([g.flatten() for g in gradients] + [loss.detach().view(1)]))

    def learn(self):
        with torch.no_grad():
            gradient, loss = self.found[:-1], self.found[-1]
            rate, first_share, second_share, kept = self.numbers.unbind()
            norm = gradient.norm()
            is_sound = torch.isfinite(norm)
            gradient = torch.where(is_sound, gradient, torch.zeros_like(gradient))
            norm = torch.where(is_sound, norm, self.norm)
            # Steps that are far larger than usual are cut. Far larger still, they tell of a view
            # that nobody can learn from, whose steps would lead the same way again and again.
            usual = torch.where(self.norm > 0.0, self.norm, norm)
            kept_share = (3.0 * usual / norm.clamp(min=1e-12)).clamp(max=1.0)
            gradient = gradient * torch.where(norm < MOST_NORM * usual, kept_share, 0.0)
            self.norm.copy_(usual + 0.02 * (torch.minimum(norm, 3.0 * usual) - usual))
            self.first.mul_(0.9).add_(gradient, alpha=0.1)
            self.second.mul_(0.99).addcmul_(gradient, gradient, value=0.01)
            root = (self.second / second_share).sqrt() + 1e-8
            self.flat.sub_(rate * (self.first / first_share) / root)
            self.mean.copy_(kept * self.mean + (1.0 - kept) * self.flat)
            self.put(self.flat)
            seen = torch.where(self.loss > 0.0, self.loss, loss)
            self.loss.copy_(seen + 0.01 * (loss - seen))

    def step(self, rate):
        self.count += 1
        n = self.count
        numbers = (
            rate * min(1.0, n / 200),
            1.0 - 0.9**n,
            1.0 - 0.99**n,
            min(KEPT, n / (n + 10.0)),
        )
        self.numbers.copy_(torch.tensor(numbers))
        self.batch.draw()
        look, learn = (g.replay for g in self.graphs) if self.graphs else (self.look, self.learn)
        look()
        self.group.average(self.found)
        learn()

    def record(self):
        """Two launches a step instead of thousands."""
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self.step(0.0)
        torch.cuda.current_stream().wait_stream(stream)
        torch.cuda.synchronize()
        graphs = []
        for work in (self.look, self.learn):
            graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(graph, capture_error_mode="thread_local"):
                work()
            graphs.append(graph)
        torch.cuda.synchronize()
        self.graphs = graphs

    def state(self):
        tensors = (self.flat, self.mean, self.first, self.second, self.norm, self.loss)
        return [t.cpu() for t in tensors], self.count

    def restore(self, state):
        tensors, self.count = state
        own = (self.flat, self.mean, self.first, self.second, self.norm, self.loss)
        for to, values in zip(own, tensors):
            to.copy_(values)
        self.put(self.flat)

    def save(self, file):
        """The average of the weights."""
        network = Network(**SIZE)
        means = self.mean.cpu().split(self.sizes)
        with torch.no_grad():
            for p, values in zip(network.parameters(), means):
                p.copy_(values.view_as(p))
        part = file.with_suffix(".part")
        network.save(part)
        part.rename(file)


def save(trainee, folder):
    part = folder / "state.part"
    torch.save(trainee.state(), part)
    part.rename(folder / "state.pt")
    trainee.save(folder / "denoiser.bin")


def train(options):
    group = Group()
    device = torch.device(options.device)
    if device.type == "cuda":
        device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)))
        torch.cuda.set_device(device)
    torch.manual_seed(options.seed)
    chance = np.random.default_rng((options.seed, group.rank, int(time.time())))
    options.out.mkdir(parents=True, exist_ok=True)
    if device.type == "cuda":
        torch.backends.cudnn.benchmark = True
        torch.backends.cuda.matmul.allow_tf32 = True
        torch.backends.cudnn.allow_tf32 = True
    pictures = Pictures(options.pictures, device, options.most_views, group)
    begun = time.time()
    threading.Thread(target=pictures.keep_looking, daemon=True).start()
    while len(pictures.views) < options.first_views and time.time() < options.until:
        time.sleep(0.2)
    trainee = Trainee(pictures, options, chance, group)
    file = options.out / "state.pt"
    if file.exists():
        trainee.restore(torch.load(file, map_location="cpu"))
    if options.graphs and device.type == "cuda":
        with pictures.lock:
            trainee.record()
    print(f"first step after {time.time() - begun:.0f} s, {len(pictures.views)} views", flush=True)
    told = saved = time.time()
    steps = 0
    rate = 0.0
    while True:
        if steps % 20 == 0:
            now = time.time()
            part = min(1.0, max(0.0, (now - options.since) / (options.until - options.since)))
            rate = options.rate * max(0.005, 0.5 + 0.5 * math.cos(math.pi * part))
            is_over = now >= options.until or steps >= options.steps
            rate, is_over = group.told([rate, float(is_over)], device)
            if is_over:
                break
        trainee.step(rate)
        steps += 1
        now = time.time()
        if now - told > options.tell or steps == 20:
            told = now
            print(f"{group.rank}: {now - begun:.0f} s, rate {rate:.5f}, {len(pictures.views)} "
                  f"views, step {trainee.count}, loss {float(trainee.loss):.4f}", flush=True)
            (options.out / "alive").touch()
        if group.rank == 0 and now - saved > options.save_every:
            saved = now
            save(trainee, options.out)
    pictures.is_done = True
    if group.rank == 0:
        save(trainee, options.out)
    print(f"{group.rank}: {trainee.count} steps, {len(pictures.views)} views", flush=True)
    if group.size > 1:
        dist.destroy_process_group()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", help="folder that denoiser_pictures writes to, or has written")
    parser.add_argument("out", type=pathlib.Path,
                        help="folder of the weights, and of what a later call goes on from")
    parser.add_argument("--begin-from", type=pathlib.Path, help="weights to begin with")
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--since", type=float, help="seconds since 1970 when the schedule began")
    parser.add_argument("--until", type=float, help="... and when it ends")
    parser.add_argument("--steps", type=int, default=10**9)
    parser.add_argument("--batch", type=int, default=48)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first-views", type=int, default=60, help="training begins with so many")
    parser.add_argument("--most-views", type=int, default=3300)
    parser.add_argument("--tell", type=float, default=15.0, help="seconds between lines")
    parser.add_argument("--save-every", type=float, default=60.0, help="seconds")
    parser.add_argument("--no-graphs", dest="graphs", action="store_false",
                        help="compile nothing, begin each piece of the GPU's work on its own")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    options = parser.parse_args()
    options.since = options.since or time.time()
    options.until = options.until or options.since + options.seconds
    train(options)


if __name__ == "__main__":
    main()
