# SPDX-License-Identifier: Apache-2.0
"""network.averaged() on a GPU: one kernel of Triton forth and three back, in place of some hundred
that each go through the whole picture."""
import torch
import triton
import triton.language as tl

BLOCK = 128
CHANNELS = 6


@triton.jit
def _places(height, width, BLOCK: tl.constexpr):
    """-> the picture's number, pixels, their rows and columns, which of them there are"""
    at = tl.program_id(0) * BLOCK + tl.arange(0, BLOCK)
    y = at // width
    return tl.program_id(1).to(tl.int64), at, y, at - y * width, at < height * width


@triton.jit
def _tap(y, x, height, width, is_pixel, k: tl.constexpr, SIDE: tl.constexpr,
         REPLICATES: tl.constexpr):
    """-> rows and columns of the pixels that tap k of SIDE x SIDE reads, which of them there are"""
    v = y + (k // SIDE - SIDE // 2)
    u = x + (k % SIDE - SIDE // 2)
    inside = is_pixel
    if REPLICATES:
        v = tl.minimum(tl.maximum(v, 0), height - 1)
        u = tl.minimum(tl.maximum(u, 0), width - 1)
    else:
        inside = is_pixel & (v >= 0) & (v < height) & (u >= 0) & (u < width)
    return v, u, inside


@triton.jit
def _gathered(plane, at, step, inside, weight, a0, a1, a2, a3, a4, a5):
    """Adds the weighted values of six layers."""
    a0 += weight * tl.load(plane + at, inside, 0.0)
    a1 += weight * tl.load(plane + step + at, inside, 0.0)
    a2 += weight * tl.load(plane + 2 * step + at, inside, 0.0)
    a3 += weight * tl.load(plane + 3 * step + at, inside, 0.0)
    a4 += weight * tl.load(plane + 4 * step + at, inside, 0.0)
    a5 += weight * tl.load(plane + 5 * step + at, inside, 0.0)
    return a0, a1, a2, a3, a4, a5


@triton.jit
def _stored(plane, at, step, inside, a0, a1, a2, a3, a4, a5):
    tl.store(plane + at, a0, inside)
    tl.store(plane + step + at, a1, inside)
    tl.store(plane + 2 * step + at, a2, inside)
    tl.store(plane + 3 * step + at, a3, inside)
    tl.store(plane + 4 * step + at, a4, inside)
    tl.store(plane + 5 * step + at, a5, inside)


@triton.jit
def _forth(values, logits, coarse, out, sums, height, width, stride, SIDE: tl.constexpr,
           HAS_COARSE: tl.constexpr, REPLICATES: tl.constexpr, BLOCK: tl.constexpr):
    image, at, y, x, is_pixel = _places(height, width, BLOCK)
    size = height * width
    fine: tl.constexpr = SIDE * SIDE
    taps: tl.constexpr = fine + (9 if HAS_COARSE else 0)
    logit = logits + image * stride + at
    most = tl.full((BLOCK,), -1e30, tl.float32)
    for k in tl.static_range(taps):
        most = tl.maximum(most, tl.load(logit + k * size, is_pixel, 0.0))
    total = tl.zeros((BLOCK,), tl.float32)
    for k in tl.static_range(taps):
        total += tl.exp(tl.load(logit + k * size, is_pixel, 0.0) - most)
    sum_of = most + tl.log(total)
    tl.store(sums + image * size + at, sum_of, is_pixel)
    zero = tl.zeros((BLOCK,), tl.float32)
    a0, a1, a2, a3, a4, a5 = zero, zero, zero, zero, zero, zero
    plane = values + image * 6 * size
    for k in tl.static_range(fine):
        v, u, inside = _tap(y, x, height, width, is_pixel, k, SIDE, REPLICATES)
        weight = tl.exp(tl.load(logit + k * size, is_pixel, 0.0) - sum_of)
        a0, a1, a2, a3, a4, a5 = _gathered(plane, v * width + u, size, inside, weight,
                                           a0, a1, a2, a3, a4, a5)
    if HAS_COARSE:
        half = width // 2
        quarter = size // 4
        below = coarse + image * 6 * quarter
        for k in tl.static_range(9):
            v, u, inside = _tap(y // 2, x // 2, height // 2, half, is_pixel, k, 3, False)
            weight = tl.exp(tl.load(logit + (fine + k) * size, is_pixel, 0.0) - sum_of)
            a0, a1, a2, a3, a4, a5 = _gathered(below, v * half + u, quarter, inside, weight,
                                               a0, a1, a2, a3, a4, a5)
    _stored(out + image * 6 * size, at, size, is_pixel, a0, a1, a2, a3, a4, a5)


@triton.jit
def _dot(plane, at, step, inside, g0, g1, g2, g3, g4, g5):
    total = g0 * tl.load(plane + at, inside, 0.0)
    total += g1 * tl.load(plane + step + at, inside, 0.0)
    total += g2 * tl.load(plane + 2 * step + at, inside, 0.0)
    total += g3 * tl.load(plane + 3 * step + at, inside, 0.0)
    total += g4 * tl.load(plane + 4 * step + at, inside, 0.0)
    total += g5 * tl.load(plane + 5 * step + at, inside, 0.0)
    return total


@triton.jit
def _back_to_logits(values, logits, coarse, out, sums, gradient, found, height, width, stride,
                    SIDE: tl.constexpr, HAS_COARSE: tl.constexpr, REPLICATES: tl.constexpr,
                    BLOCK: tl.constexpr):
    image, at, y, x, is_pixel = _places(height, width, BLOCK)
    size = height * width
    fine: tl.constexpr = SIDE * SIDE
    taps: tl.constexpr = fine + (9 if HAS_COARSE else 0)
    logit = logits + image * stride + at
    to = found + image * taps * size + at
    sum_of = tl.load(sums + image * size + at, is_pixel, 0.0)
    g = gradient + image * 6 * size + at
    g0 = tl.load(g, is_pixel, 0.0)
    g1 = tl.load(g + size, is_pixel, 0.0)
    g2 = tl.load(g + 2 * size, is_pixel, 0.0)
    g3 = tl.load(g + 3 * size, is_pixel, 0.0)
    g4 = tl.load(g + 4 * size, is_pixel, 0.0)
    g5 = tl.load(g + 5 * size, is_pixel, 0.0)
    # What all weights together bring: they add up to one.
    mean = _dot(out + image * 6 * size, at, size, is_pixel, g0, g1, g2, g3, g4, g5)
    plane = values + image * 6 * size
    for k in tl.static_range(fine):
        v, u, inside = _tap(y, x, height, width, is_pixel, k, SIDE, REPLICATES)
        weight = tl.exp(tl.load(logit + k * size, is_pixel, 0.0) - sum_of)
        own = _dot(plane, v * width + u, size, inside, g0, g1, g2, g3, g4, g5)
        tl.store(to + k * size, weight * (own - mean), is_pixel)
    if HAS_COARSE:
        half = width // 2
        quarter = size // 4
        below = coarse + image * 6 * quarter
        for k in tl.static_range(9):
            v, u, inside = _tap(y // 2, x // 2, height // 2, half, is_pixel, k, 3, False)
            weight = tl.exp(tl.load(logit + (fine + k) * size, is_pixel, 0.0) - sum_of)
            own = _dot(below, v * half + u, quarter, inside, g0, g1, g2, g3, g4, g5)
            tl.store(to + (fine + k) * size, weight * (own - mean), is_pixel)


@triton.jit
def _back_to_values(logits, sums, gradient, found, height, width, stride, SIDE: tl.constexpr,
                    BLOCK: tl.constexpr):
    image, at, y, x, is_pixel = _places(height, width, BLOCK)
    size = height * width
    zero = tl.zeros((BLOCK,), tl.float32)
    a0, a1, a2, a3, a4, a5 = zero, zero, zero, zero, zero, zero
    for k in tl.static_range(SIDE * SIDE):
        # The pixel whose tap k reads this one lies where the opposite tap would read.
        v, u, inside = _tap(y, x, height, width, is_pixel, SIDE * SIDE - 1 - k, SIDE, False)
        there = v * width + u
        weight = tl.exp(tl.load(logits + image * stride + k * size + there, inside, 0.0)
                        - tl.load(sums + image * size + there, inside, 0.0))
        a0, a1, a2, a3, a4, a5 = _gathered(gradient + image * 6 * size, there, size, inside,
                                           weight, a0, a1, a2, a3, a4, a5)
    _stored(found + image * 6 * size, at, size, is_pixel, a0, a1, a2, a3, a4, a5)


@triton.jit
def _back_to_coarse(logits, sums, gradient, found, height, width, stride, FINE: tl.constexpr,
                    BLOCK: tl.constexpr):
    """`height`, `width`: of the coarse level."""
    image, at, y, x, is_pixel = _places(height, width, BLOCK)
    size = height * width * 4
    zero = tl.zeros((BLOCK,), tl.float32)
    a0, a1, a2, a3, a4, a5 = zero, zero, zero, zero, zero, zero
    for k in tl.static_range(9):
        v, u, inside = _tap(y, x, height, width, is_pixel, 8 - k, 3, False)
        for part in tl.static_range(4):
            there = (2 * v + part // 2) * (2 * width) + 2 * u + part % 2
            logit = logits + image * stride + (FINE + k) * size + there
            weight = tl.exp(tl.load(logit, inside, 0.0)
                            - tl.load(sums + image * size + there, inside, 0.0))
            a0, a1, a2, a3, a4, a5 = _gathered(gradient + image * 6 * size, there, size, inside,
                                               weight, a0, a1, a2, a3, a4, a5)
    _stored(found + image * 6 * (size // 4), at, size // 4, is_pixel, a0, a1, a2, a3, a4, a5)


class _Average(torch.autograd.Function):
    @staticmethod
    def forward(ctx, values, logits, side, coarse, replicates):
        batch, channels, height, width = values.shape
        assert channels == CHANNELS and values.dtype == logits.dtype == torch.float32
        values = values.contiguous()
        if logits.stride()[1:] != (height * width, width, 1):
            logits = logits.contiguous()
        coarse = None if coarse is None else coarse.contiguous()
        out = torch.empty_like(values)
        sums = torch.empty((batch, height, width), device=values.device)
        grid = (triton.cdiv(height * width, BLOCK), batch)
        _forth[grid](values, logits, coarse, out, sums, height, width, logits.stride(0), SIDE=side,
                     HAS_COARSE=coarse is not None, REPLICATES=replicates, BLOCK=BLOCK)
        ctx.save_for_backward(values, logits, coarse, out, sums)
        ctx.side, ctx.replicates = side, replicates
        return out

    @staticmethod
    def backward(ctx, gradient):
        values, logits, coarse, out, sums = ctx.saved_tensors
        batch, _, height, width = values.shape
        gradient = gradient.contiguous()
        has_coarse = coarse is not None
        stride = logits.stride(0)
        grid = (triton.cdiv(height * width, BLOCK), batch)
        to_values = to_coarse = None
        to_logits = torch.empty(logits.shape, device=logits.device)
        _back_to_logits[grid](values, logits, coarse, out, sums, gradient, to_logits, height, width,
                              stride, SIDE=ctx.side, HAS_COARSE=has_coarse,
                              REPLICATES=ctx.replicates, BLOCK=BLOCK)
        if ctx.needs_input_grad[0]:
            assert not ctx.replicates
            to_values = torch.empty_like(values)
            _back_to_values[grid](logits, sums, gradient, to_values, height, width, stride,
                                  SIDE=ctx.side, BLOCK=BLOCK)
        if has_coarse and ctx.needs_input_grad[3]:
            to_coarse = torch.empty_like(coarse)
            grid = (triton.cdiv(height * width // 4, BLOCK), batch)
            _back_to_coarse[grid](logits, sums, gradient, to_coarse, height // 2, width // 2,
                                  stride, FINE=ctx.side**2, BLOCK=BLOCK)
        return to_values, to_logits, None, to_coarse, None


@torch.compiler.disable  # is one kernel as it is
def averaged(values, logits, side, coarse=None, replicates=False):
    return _Average.apply(values, logits, side, coarse, replicates)


def check():
    """Compares with plain PyTorch, forth and back, for every way in which it is used."""
    import network

    torch.manual_seed(1)
    height, width = 36, 52
    for side, has_coarse, replicates in ((5, True, False), (5, False, False), (3, False, True)):
        taps = side * side + (network.COARSE if has_coarse else 0)
        shape = (3, CHANNELS, height, width)
        values = torch.rand(shape, device="cuda", requires_grad=not replicates)
        logits = (2.0 * torch.randn((3, taps + 5, height, width), device="cuda")).requires_grad_()
        coarse = torch.rand((3, CHANNELS, height // 2, width // 2), device="cuda").requires_grad_()
        inputs = [v for v in (values, logits, coarse if has_coarse else None)
                  if v is not None and v.requires_grad]
        gradient = torch.randn(shape, device="cuda")
        found = []
        kernels = network.fused
        for network.fused in (None, kernels):
            out = network.averaged(values, logits[:, 2 : 2 + taps], side,
                                   coarse if has_coarse else None, replicates)
            found.append([out, *torch.autograd.grad(out, inputs, gradient)])
        for plain, own in zip(*found):
            torch.testing.assert_close(own, plain, rtol=1e-4, atol=1e-5)
    print("all as in plain PyTorch")


if __name__ == "__main__":
    check()
