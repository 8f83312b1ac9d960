#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the soak calls flat, and what not."""
import math
import random
import unittest

import soak

CYCLE = 64


def memory(captures, growth_per_1000=0.0, fill=0, swing=30.0):
    """Of a program of 100 MiB whose rooms take between 0 and `swing` in a cycle."""
    rng = random.Random(1)
    return [100.0 + swing * (at % CYCLE) / CYCLE + rng.uniform(-3, 3) + growth_per_1000 * at / 1000 +
            (fill * (1 - math.exp(-at / 300)) if fill else 0) for at in range(captures)]


class Verdict(unittest.TestCase):
    def is_flat(self, samples):
        return soak.verdict(samples, CYCLE)[0]

    def test_what_swings_is_flat(self):
        self.assertTrue(self.is_flat(memory(10000)))
        self.assertTrue(self.is_flat(memory(600, swing=80.0)))

    def test_a_cycle_that_is_cut_counts_as_one(self):
        for captures in range(1000, 1000 + CYCLE, 7):
            self.assertTrue(self.is_flat(memory(captures, swing=80.0)))

    def test_a_leak_grows(self):
        self.assertFalse(self.is_flat(memory(10000, growth_per_1000=1.0)))
        self.assertTrue(self.is_flat(memory(10000, growth_per_1000=0.2)))
        self.assertFalse(self.is_flat(memory(600, growth_per_1000=30.0)))

    def test_a_cache_that_fills_grows_but_has_no_slope(self):
        is_flat, text = soak.verdict(memory(10000, fill=20.0), CYCLE)
        self.assertFalse(is_flat)
        self.assertLess(abs(float(text.split()[4])), 0.2)

    def test_too_few_captures_are_no_verdict(self):
        with self.assertRaisesRegex(soak.Fault, "178 are needed"):
            soak.verdict(memory(177), CYCLE)
        self.assertTrue(self.is_flat(memory(178)))


if __name__ == "__main__":
    unittest.main()
