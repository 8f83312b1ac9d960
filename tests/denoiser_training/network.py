# SPDX-License-Identifier: Apache-2.0
"""The denoiser's network and what surrounds it.

A U-Net on blocks of 2x2 pixels predicts kernels for six levels of a pyramid. They average pairs of
scattered light and the surfaces' colours; only their quotient, the light that falls on a surface, is
used, times the pixel's own colour, averaged by a third kernel over 3x3 pixels. Where there is noise
the levels may also become brighter or darker. Of each pixel a share is what the filter by planes
made of it, which the network sees, too, and a share is left as it was.
"""
import struct

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

try:
    import fused
except ImportError:  # without Triton
    fused = None

CHANNELS = 19  # of a film
FEATURES = 20  # per pixel, of the network's input
LEVELS = 6  # of the pyramid
FINE = 25  # taps of a level's own pixels,
COARSE = 9  # of the next level's result,
OWN = 9  # of the pixel's colour
ALIGNMENT = 32  # pixels, so that all levels have whole ones
MIN_ALBEDO = 0.02
TIMES_OTHERS = 4.0
LIMITED_PATHS = 16.0
SMALLEST = 1e-6
PRIOR_BIAS = 0.1  # what a picture's mean is off by before it is set right
MOST_GAIN = 1.0  # of a level, where it is all noise
CALM_LEVEL = 3  # whose noise says whether there is any,
CALM = 0.002  # so much of the light or more
MAGIC = 0x574E4544  # "DENW"
VERSION = 3


def luminance(rgb):
    return (0.2126 * rgb[:, 0:1] + 0.7152 * rgb[:, 1:2]) + 0.0722 * rgb[:, 2:3]


def box3(values):
    return 9.0 * F.avg_pool2d(values, 3, 1, 1)


class Film:
    """Films of equal size as the network takes them; channels as make_pictures.cpp writes them."""

    def __init__(self, raw, paths, exposure, firefly_limit=4.0):
        n = paths.view(-1, 1, 1, 1)
        e = exposure.view(-1, 1, 1, 1)
        self.seen = raw[:, 0:3]
        scattered, albedo, normal = raw[:, 3:6], raw[:, 6:9], raw[:, 9:12]
        distance, deviation, brightest, share = (raw[:, k : k + 1] for k in range(12, 16))
        own = luminance(scattered)
        variance = deviation * deviation
        # The brightest path brings no more than is believable.
        times = torch.clamp(n / LIMITED_PATHS, min=1.0)
        others = box3(own * n - brightest)
        count = box3((n - 1.0).expand_as(own))
        limit = firefly_limit / e
        most = times * (limit + TIMES_OTHERS * others.clamp(min=0.0) / count.clamp(min=1.0))
        removed = torch.minimum(own, (brightest - most) / n).clamp(min=0.0)
        removed = torch.where((n > 1.5) & (brightest > limit * times), removed, torch.zeros_like(own))
        less = own - removed
        squares = variance * (n - 1.0) + own * own - (brightest**2 - most**2) / n
        cut = (squares - less * less).clamp(min=0.0) / (n - 1.0).clamp(min=1.0)
        variance = torch.where(removed > 0.0, cut, variance)
        self.scattered = scattered * torch.where(own > 0.0, less / own.clamp(min=1e-30), own)
        self.albedo = torch.maximum(albedo, MIN_ALBEDO * share)
        self.own_albedo = self.albedo
        irradiance = self.scattered / self.albedo.clamp(min=SMALLEST)
        self.planes = raw[:, 16:19]
        planes = (self.planes - self.seen).clamp(min=0.0)
        planes_irradiance = planes / self.albedo.clamp(min=SMALLEST)
        seen = luminance(self.seen)
        shade = less * e
        noise = variance.sqrt() * e
        relative = noise / (shade + 0.02)
        # Of a single path nobody knows.
        self.noise = torch.cat([torch.where(n > 1.5, noise, shade + 0.02), shade + 0.02], 1)
        peak = brightest / (n * own).clamp(min=1e-12)
        self.features = torch.cat(
            [
                torch.log1p(8.0 * e * irradiance) / 3.0,
                albedo,
                normal,
                torch.log1p(distance) / 2.0,
                relative / (1.0 + relative),
                torch.log1p(8.0 * e * seen) / 3.0,
                share,
                peak.clamp(0.0, 1.0),
                (torch.log2(n) / 8.0).expand_as(share),
                torch.log1p(8.0 * shade) / 3.0,
                torch.log1p(8.0 * e * planes_irradiance) / 3.0,
                torch.log1p(8.0 * e * luminance(planes)) / 3.0,
            ],
            1,
        )


class Convs(nn.Module):
    """3x3 convolutions with ReLU, one after the other."""

    def __init__(self, begin, width, count):
        super().__init__()
        self.layers = nn.ModuleList(
            nn.Conv2d(begin if i == 0 else width, width, 3, padding=1) for i in range(count)
        )

    def forward(self, x):
        for layer in self.layers:
            x = F.relu(layer(x))
        return x


class Network(nn.Module):
    """Film features -> logits per level, the finest first.

    widths: of the five levels from half the resolution on; encoder, decoder: convolutions there."""

    def __init__(self, widths=(48, 64, 80, 80, 80), encoder=(2, 2, 2, 2, 2), decoder=(2, 2, 2, 2)):
        super().__init__()
        self.widths, self.encoder_counts, self.decoder_counts = widths, encoder, decoder
        begins = (4 * FEATURES,) + tuple(widths[:-1])
        self.encoder = nn.ModuleList(Convs(b, w, c) for b, w, c in zip(begins, widths, encoder))
        self.narrow = nn.ModuleList(
            nn.Conv2d(widths[i + 1], widths[i], 1) for i in range(len(widths) - 1)
        )
        self.decoder = nn.ModuleList(Convs(w, w, c) for w, c in zip(widths[:-1], decoder))
        pixel = FINE + COARSE + OWN + 4
        level = FINE + COARSE + 2
        self.heads = nn.ModuleList(
            nn.Conv2d(w, level + (4 * pixel if i == 0 else 0), 1) for i, w in enumerate(widths)
        )
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                nn.init.zeros_(module.bias)
        with torch.no_grad():
            for i, head in enumerate(self.heads):
                head.weight.mul_(0.1)
                head.bias[FINE // 2] = 1.0
                if i == 0:
                    finest = head.bias[level:].view(pixel, 4)
                    finest[FINE // 2] = 1.0
                    finest[FINE + COARSE + OWN // 2] = 5.0
                    finest[-2] = -1.0
                    finest[-1] = -3.0

    def forward(self, features):
        x = F.pixel_unshuffle(features, 2)
        skips = []
        for i, convs in enumerate(self.encoder):
            x = convs(x if i == 0 else F.max_pool2d(x, 2))
            skips.append(x)
        logits = [self.heads[-1](x)]
        for i in reversed(range(len(self.widths) - 1)):
            x = skips[i] + F.interpolate(self.narrow[i](x), scale_factor=2, mode="nearest")
            x = self.decoder[i](x)
            logits.insert(0, self.heads[i](x))
        level = FINE + COARSE + 2
        finest = F.pixel_shuffle(logits[0][:, level:], 2)
        # Each kernel's weights side by side, wherever they came from.
        return [l.float().contiguous() for l in (finest, logits[0][:, :level], *logits[1:])]

    def grown(self, widths, encoder, decoder):
        """-> a network at least as wide that says the same: nothing listens to further channels."""
        network = Network(widths, encoder, decoder)
        with torch.no_grad():
            for layer, old in zip(network.layers(), self.layers(), strict=True):
                outputs, inputs = old.weight.shape[:2]
                layer.weight[:outputs, inputs:] = 0.0
                layer.weight[:outputs, :inputs] = old.weight
                layer.bias[:outputs] = old.bias
        return network

    def layers(self):
        """In the order of the file."""
        for convs in self.encoder:
            yield from convs.layers
        for i in reversed(range(len(self.widths) - 1)):
            yield self.narrow[i]
            yield from self.decoder[i].layers
        yield from self.heads

    def save(self, path):
        with open(path, "wb") as out:
            numbers = (MAGIC, VERSION, *self.widths, *self.encoder_counts, *self.decoder_counts)
            out.write(struct.pack(f"<{len(numbers)}i", *numbers))
            for layer in self.layers():
                for tensor in (layer.weight, layer.bias):
                    out.write(tensor.detach().cpu().numpy().astype("<f2").tobytes())

    @staticmethod
    def load(path):
        with open(path, "rb") as file:
            numbers = struct.unpack("<16i", file.read(64))
            if numbers[:2] != (MAGIC, VERSION):
                raise ValueError(f"{path}: not the weights of a denoiser")
            network = Network(numbers[2:7], numbers[7:12], numbers[12:16])
            with torch.no_grad():
                for layer in network.layers():
                    for tensor in (layer.weight, layer.bias):
                        values = np.frombuffer(file.read(2 * tensor.numel()), "<f2")
                        tensor.copy_(torch.from_numpy(values.astype(np.float32)).view_as(tensor))
        return network


def shifted(padded, k, side, height, width):
    y, x = divmod(k, side)
    return padded[:, :, y : y + height, x : x + width]


def averaged(values, logits, side, coarse=None, replicates=False):
    """Of the pixels around, and of those of the next level, by the softmax of a pixel's `logits`.
    Beside the picture is nothing, or what is at its edge."""
    if values.is_cuda and fused:
        return fused.averaged(values, logits, side, coarse, replicates)
    weights = F.softmax(logits, 1)
    height, width = values.shape[2:]
    padded = F.pad(values, (side // 2,) * 4, mode="replicate" if replicates else "constant")
    total = 0.0
    for k in range(side * side):
        total = total + weights[:, k : k + 1] * shifted(padded, k, side, height, width)
    if coarse is not None:
        padded = F.pad(coarse, (1,) * 4)
        for k in range(COARSE):
            part = widened(shifted(padded, k, 3, height // 2, width // 2))
            total = total + weights[:, side * side + k : side * side + k + 1] * part
    return total


def widened(values):
    return F.interpolate(values, scale_factor=2, mode="nearest")


def noise_share(noise, times=1.0):
    """How much of what a pixel shows is noise, which counts as all where the light, so many times,
    is far less."""
    return noise[:, 0:1] / (noise[:, 0:1] + times * noise[:, 1:2]).clamp(min=1e-12)


def gained(pairs, logit, noise):
    """Light of a level, as much brighter or darker as the network says and its noise allows."""
    gain = 1.0 + MOST_GAIN * noise_share(noise) * F.softsign(logit)
    return torch.cat([pairs[:, :3] * gain, pairs[:, 3:]], 1)


def denoised(film, logits):
    """Light and colour; `logits` are of the network: per level FINE, COARSE, (the finest) OWN, what
    the pixel counts for the next level, and its gain (the finest also: the share of the filter by
    planes, and that of the pixel as it was)."""
    taps, own_taps, keep, gain, other, stays = logits[0].split((FINE + COARSE, OWN, 1, 1, 1, 1), 1)
    parts = [(taps, keep, gain)] + [l.split((FINE + COARSE, 1, 1), 1) for l in logits[1:]]
    pairs, noise = [torch.cat([film.scattered, film.albedo], 1)], [film.noise]
    for level in range(LEVELS - 1):
        keep = F.softmax(F.pixel_unshuffle(parts[level][1], 2), 1)
        quads = F.pixel_unshuffle(pairs[level], 2)
        b, _, h, w = keep.shape
        pairs.append((quads.view(b, 6, 4, h, w) * keep.unsqueeze(1)).sum(2))
        noise.append(F.avg_pool2d(noise[level], 2))
    result = averaged(pairs[-1], parts[-1][0][:, :FINE], 5)
    for level in reversed(range(LEVELS - 1)):
        result = gained(result, parts[level + 1][2], noise[level + 1])
        result = averaged(pairs[level], parts[level][0], 5, result)
    gain = 1.0 + MOST_GAIN * noise_share(noise[0]) * torch.tanh(0.5 * gain)
    irradiance = gain * result[:, :3] / result[:, 3:].clamp(min=SMALLEST)
    height, width = film.planes.shape[2:]
    own = torch.cat([film.own_albedo, film.seen], 1)
    own = averaged(own, own_taps[:, :, :height, :width], 3, replicates=True)
    clean = irradiance[:, :, :height, :width] * own[:, :3] + own[:, 3:]
    # Where nothing is noisy, planes change nothing.
    needed = noise_share(noise[CALM_LEVEL], CALM)
    needed = F.interpolate(needed, scale_factor=1 << CALM_LEVEL, mode="nearest")
    own_share = needed * torch.sigmoid(-other)
    clean = film.planes + own_share[:, :, :height, :width] * (clean - film.planes)
    stays = torch.sigmoid(stays[:, :, :height, :width])
    return clean + stays * (film.scattered[:, :, :height, :width] + film.seen - clean)


def rebalanced(picture, film, raw):
    """With the mean of the undenoised picture, as far as its noise lets that be known. What is seen
    directly stays; its edges, which are smoothed, have a mean of their own."""
    shown = luminance(film.seen)
    most, least = F.max_pool2d(shown, 3, 1, 1), -F.max_pool2d(-shown, 3, 1, 1)
    light, after = luminance(raw[:, 3:6]) + shown, luminance(picture)
    variance = raw[:, 13:14] ** 2

    def gain(counts):
        before = (counts * light).sum((1, 2, 3), keepdim=True)
        uncertain = (counts * variance).sum((1, 2, 3), keepdim=True) / (before**2).clamp(min=1e-12)
        trust = PRIOR_BIAS**2 / (PRIOR_BIAS**2 + uncertain)
        wanted = before / (counts * after).sum((1, 2, 3), keepdim=True).clamp(min=1e-12)
        return torch.where(before > 0.0, 1.0 + trust * (wanted.clamp(0.5, 2.0) - 1.0), 1.0)

    is_edge = most != least
    seen = torch.minimum(film.seen, picture)
    even = seen + gain((most == 0.0).float()) * (picture - seen)
    return torch.where(is_edge, gain(is_edge.float()) * picture, even)


def denoise(network, raw, paths, exposure):
    """Pictures of any size: beside them is nothing."""
    film = Film(raw, paths, exposure)
    height, width = raw.shape[2:]
    pad = (0, -width % ALIGNMENT, 0, -height % ALIGNMENT)
    whole = Film.__new__(Film)
    whole.seen, whole.own_albedo, whole.planes = film.seen, film.own_albedo, film.planes
    whole.scattered, whole.albedo = F.pad(film.scattered, pad), F.pad(film.albedo, pad)
    whole.noise = F.pad(film.noise, pad)
    picture = denoised(whole, network(F.pad(film.features, pad)))
    return rebalanced(picture, film, raw)
