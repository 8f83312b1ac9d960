#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the small network of denoiser_network_test.cpp and prints what PyTorch makes of it."""
import argparse

import numpy as np
import torch

from network import FEATURES, Network


def features(width, height):
    """The same formula stands in the test."""
    c, y, x = np.meshgrid(np.arange(FEATURES), np.arange(height), np.arange(width), indexing="ij")
    values = np.sin(0.37 * c + 0.11 * x + 0.23 * y) + 0.25 * np.cos(0.05 * x * (c % 3) - 0.31 * y)
    return torch.from_numpy(values.astype(np.float32))[None]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", help="tests/plugins/renderer_support/denoiser_network.bin")
    path = parser.parse_args().out
    torch.manual_seed(7)
    # No width is a whole number of vectors everywhere, and counts differ.
    network = Network((20, 18, 16, 24, 12), (1, 2, 1, 1, 1), (1, 0, 2, 1))
    for layer in network.layers():
        torch.nn.init.normal_(layer.bias, 0.0, 0.2)
    for head in network.heads:
        torch.nn.init.normal_(head.weight, 0.0, 0.1)
    network.save(path)
    network = Network.load(path)
    with torch.no_grad():
        logits = network(features(96, 64))
    for level, values in enumerate(logits):
        height, width = values.shape[2:]
        last = 4 if level == 0 else 2
        for channel in (0, 17, *range(values.shape[1] - last, values.shape[1])):
            for x, y in ((0, 0), (width - 1, height // 2), (width // 3, height - 1)):
                print(f"{{{level}, {channel}, {x}, {y}, {values[0, channel, y, x]:.6f}f}},")


if __name__ == "__main__":
    main()
