#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the renderer's denoiser, its parts, networks and Open Image Denoise on films that
denoiser_pictures --judge made."""
import argparse
import json
import math
import pathlib
import struct

import numpy as np
import torch
import torch.nn.functional as F

from network import Network, denoise, luminance
from train import edges_of, read_films, spread


def read_tza(path):
    """Open Image Denoise's file of named tensors."""
    data = pathlib.Path(path).read_bytes()
    magic, _, _, table = struct.unpack_from("<HBBQ", data)
    if magic != 0x41D7:
        raise ValueError(f"{path}: no weights of Open Image Denoise")
    (count,) = struct.unpack_from("<I", data, table)
    at = table + 4
    tensors = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        at += 2 + length
        rank = data[at]
        shape = struct.unpack_from(f"<{rank}I", data, at + 1)
        at += 1 + 4 * rank + rank
        kind = {"f": "<f4", "h": "<f2"}[chr(data[at])]
        (offset,) = struct.unpack_from("<Q", data, at + 1)
        at += 9
        values = np.frombuffer(data, kind, math.prod(shape), offset).reshape(shape)
        tensors[name] = torch.from_numpy(values.astype(np.float32))
    return tensors


class Oidn:
    A, B, C, D = 1.41283765e03, 1.64593172e00, 4.31384981e-01, -2.94139609e-03
    E, FF, G = 1.92653254e-01, 6.26026094e-03, 9.98620152e-01
    Y0, Y1, X0, X1 = 1.57945760e-06, 3.22087631e-02, 2.23151711e-03, 3.70974749e-01

    def __init__(self, path, device):
        self.w = {k: v.to(device) for k, v in read_tza(path).items()}
        self.scale = 1.0 / float(self.curve(torch.tensor([65504.0])))

    def curve(self, y):
        low = self.A * y
        middle = self.B * y.clamp(min=1e-12) ** self.C + self.D
        return torch.where(y <= self.Y0, low, torch.where(y <= self.Y1, middle,
                                                          self.E * torch.log(y + self.FF) + self.G))

    def uncurve(self, x):
        low = x / self.A
        middle = ((x - self.D).clamp(min=1e-12) / self.B) ** (1.0 / self.C)
        high = torch.exp((x - self.G) / self.E) - self.FF
        return torch.where(x <= self.X0, low, torch.where(x <= self.X1, middle, high))

    def conv(self, name, x, relu=True):
        y = F.conv2d(x, self.w[name + ".weight"], self.w[name + ".bias"], padding=1)
        return F.relu(y) if relu else y

    def network(self, x):
        def pool(v):
            return F.max_pool2d(v, 2)

        def up(v, skip):
            return torch.cat([F.interpolate(v, scale_factor=2, mode="nearest"), skip], 1)

        c = self.conv
        p1 = pool(c("enc_conv1", c("enc_conv0", x)))
        p2 = pool(c("enc_conv2", p1))
        p3 = pool(c("enc_conv3", p2))
        p4 = pool(c("enc_conv4", p3))
        y = c("enc_conv5b", c("enc_conv5a", p4))
        y = c("dec_conv4b", c("dec_conv4a", up(y, p3)))
        y = c("dec_conv3b", c("dec_conv3a", up(y, p2)))
        y = c("dec_conv2b", c("dec_conv2a", up(y, p1)))
        y = c("dec_conv1b", c("dec_conv1a", up(y, x)))
        return c("dec_conv0", y, relu=False)

    def __call__(self, raw, with_seen):
        color = raw[:, 0:3] * (1.0 if with_seen else 0.0) + raw[:, 3:6]
        height, width = color.shape[2:]
        blocks = F.adaptive_avg_pool2d(luminance(color), (-(-height // 16), -(-width // 16)))
        lit = blocks[blocks > 1e-8]
        exposure = 0.18 / float(torch.exp2(torch.log2(lit).mean())) if lit.numel() else 1.0
        x = self.curve(color.clamp(0.0) * exposure) * self.scale
        inputs = torch.cat([x, raw[:, 6:9].clamp(0, 1), 0.5 * raw[:, 9:12].clamp(-1, 1) + 0.5], 1)
        pad = (0, -width % 16, 0, -height % 16)
        y = self.network(F.pad(inputs, pad))[:, :, :height, :width]
        result = self.uncurve(y.clamp(min=0.0) / self.scale) / exposure
        return result if with_seen else result + raw[:, 0:3]


def shown(light):
    light = light.clamp(min=0.0)
    curve = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    return curve.clamp(0.0, 1.0) ** (1.0 / 2.2)


def box(values, side):
    return F.avg_pool2d(values, side, 1, side // 2, count_include_pad=False)


def errors(picture, references, edges):
    """relMSE against both references by turns, so that their own noise cancels; root mean square of
    what is seen on edges. Relative to the mean brightness of 5x5 pixels: were it that of the pixel,
    references that are dark by chance would count most, and dark pictures would win."""
    first, second = references
    mean = 0.5 * (first + second)
    around = box(luminance(mean), 5)
    scale = 1.0 / (around * around + 0.01)
    pixels = ((picture - first) * (picture - second) * scale).mean(1).flatten()
    plain = ((picture - mean) ** 2 * scale).mean(1).flatten()
    kept = plain.argsort()[: int(0.999 * len(plain))]
    seen = ((shown(picture) - shown(first)) * (shown(picture) - shown(second))).mean(1, keepdim=True)
    return {
        "rel_mse": float(pixels[kept].mean()),
        "plain": float(plain[kept].mean()),
        "edges": float(seen[edges].mean().clamp(min=0.0) ** 0.5),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("films", type=pathlib.Path)
    parser.add_argument("--network", action="append", default=[], help="NAME=FILE")
    parser.add_argument("--oidn", action="append", default=[], help="NAME=FILE.tza")
    parser.add_argument("--out", type=pathlib.Path, help="folder for pictures and numbers")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    options = parser.parse_args()
    device = torch.device(options.device)
    ways = {"noisy": lambda raw, n, e: raw[:, 0:3] + raw[:, 3:6]}
    ways["cached"] = ways["noisy"]
    blind = {"noisy"}  # get films whose paths did not end in a cache
    for item in options.oidn:
        name, path = item.split("=")
        judge = Oidn(path, device)
        ways[name] = lambda raw, n, e, judge=judge: judge(raw, True)
        blind |= {name, name + "_scattered"}
        ways[name + "_scattered"] = lambda raw, n, e, judge=judge: judge(raw, False)
    for item in options.network:
        name, path = item.split("=")
        network = Network.load(path).to(device).eval()
        ways[name] = lambda raw, n, e, network=network: denoise(network, raw, n, e)
    table = []
    for path in sorted(options.films.glob("*.films")):
        values, paths, counted, exposures = read_films(path)
        height, width = values.shape[2:]
        own = {}
        for part in ("own", "planes"):
            data = np.frombuffer(path.with_suffix("." + part).read_bytes(), "<f2")
            data = data.reshape(-1, 3, height, width).astype(np.float32)
            own[part] = torch.from_numpy(data).to(device)
        films = torch.from_numpy(values.astype(np.float32)).to(device)
        plain = torch.from_numpy(read_films(path.with_suffix(".plain"))[0].astype(np.float32))
        plain = plain.to(device)
        counts = torch.tensor(paths[-2:], dtype=torch.float32, device=device)
        references = spread(films[-2:], counts).split(1)
        edges = edges_of(0.5 * (films[-2:-1] + films[-1:]))
        rows = []
        for i in range(len(paths) - 2):
            raw = films[i : i + 1]
            noisy_raw = plain[i : i + 1]
            n = torch.tensor([float(counted[i])], device=device)
            e = torch.tensor([exposures[i]], device=device)
            pictures = {}
            with torch.no_grad():
                for name, way in ways.items():
                    pictures[name] = way(noisy_raw if name in blind else raw, n, e)
            pictures.update((part, values[i : i + 1]) for part, values in own.items())
            noisy = float((noisy_raw[:, 0:3] + noisy_raw[:, 3:6]).mean())
            for name, picture in pictures.items():
                table.append({"view": path.stem, "paths": paths[i], "way": name,
                              "mean": float(picture.mean()) / max(noisy, 1e-6),
                              **errors(picture, references, edges)})
            wanted = [w for w in pictures if not w.endswith("_scattered")]
            rows.append(torch.cat([shown(pictures[w])[0] for w in wanted]
                                  + [shown(0.5 * (references[0] + references[1]))[0]], 2))
        if options.out:
            write_png(torch.cat(rows, 1), options.out / (path.stem + ".png"))
    summarize(table)
    if options.out:
        (options.out / "errors.json").write_text(json.dumps(table, indent=0))


def write_png(picture, path):
    picture = (255.0 * picture.clamp(0, 1) + 0.5).to(torch.uint8).cpu()
    try:
        from torchvision.io import write_png as write

        write(picture, str(path))
    except ImportError:
        import cv2

        cv2.imwrite(str(path), picture.permute(1, 2, 0).numpy()[:, :, ::-1])


def summarize(table):
    """Geometric means over the views."""
    ways = list(dict.fromkeys(row["way"] for row in table))
    for kind in ("room", "other"):
        rows = [r for r in table if r["view"].startswith("room") == (kind == "room")]
        for paths in sorted({r["paths"] for r in rows}):
            print(f"{kind}, {paths} paths: relMSE (with noise of the references), edges, mean of the noisy")
            for way in ways:
                found = [r for r in rows if r["way"] == way and r["paths"] == paths]

                def over_views(key):
                    return math.exp(np.mean([math.log(max(r[key], 1e-6)) for r in found]))

                bias = np.mean([abs(r["mean"] - 1.0) for r in found])
                print(f"  {way:22} {over_views('rel_mse'):.5f} ({over_views('plain'):.5f}) "
                      f"{over_views('edges'):.4f} {over_views('mean'):.4f} |{bias:.4f}|")


if __name__ == "__main__":
    main()
