#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares two builds of a renderer in rooms that are hard to light: relative variance of a pixel, CPU
seconds, and efficiency (1 / (variance x CPU seconds)), all in one run, the two in turns.

  --program    default: build/release/bin/diorama
  --loaders    folder with loader_usd.so, if not beside the program
  --assets     folder with Isaac/ and NVIDIA/ of the sample pack (build/release/share/diorama/assets)
  --data       assets root with rooms made by others; without it these are left out
  --now, --before  folders with the two renderers' plugins; --before may be left out
  --set tuning|judging  which rooms; both are different rooms
Two independent pictures of each give the variance, so that no error of a reference enters; it is relative
to the brightness of their mean, with 5 % of the median added. Trimmed: without the worst 0.1 % of the pixels.
Wants python3 with numpy and OpenCV.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2
import numpy as np

ROOMS = "Isaac/Samples/Replicator/Infinigen/dining_rooms/dining_room_%d/export_scene.blend/export_scene.usdc"
SKIES = "NVIDIA/Assets/Skies/"
CLOUDY = SKIES + "Cloudy/kloofendal_48d_partly_cloudy_4k.hdr"
CHAMPAGNE = SKIES + "Cloudy/champagne_castle_1_4k.hdr"
CLEAR = SKIES + "Clear/qwantani_4k.hdr"
EVENING = SKIES + "Evening/evening_road_01_4k.hdr"

# Name, whose room, its number, sky, turn of the sky in degrees, elevation and azimuth of a sun, whether the
# room's own lamps are lit, more lamps.
SETS = {
    "tuning": [
        ("5 sky", "ours", 5, CLOUDY, 20, None, False, 0),
        ("5 sun and sky", "ours", 5, CHAMPAGNE, 0, (35, 250), False, 0),
        ("8 lamps in shades", "ours", 8, None, 0, None, True, 0),
        ("8 sky and lamps", "ours", 8, CLEAR, 110, None, True, 0),
        ("furnished 1", "data", 1, None, 0, None, True, 0),
    ],
    "judging": [
        ("1 sky", "ours", 1, CLEAR, 70, None, False, 0),
        ("3 sky", "ours", 3, CLOUDY, 200, None, False, 0),
        ("3 sun and sky", "ours", 3, EVENING, 0, (30, 20), False, 0),
        ("6 sun and sky", "ours", 6, CHAMPAGNE, 0, (50, 130), False, 0),
        ("1 lamps in shades", "ours", 1, None, 0, None, True, 0),
        ("6 lamps in shades", "ours", 6, None, 0, None, True, 0),
        ("6 many lamps", "ours", 6, None, 0, None, True, 16),
        ("3 sky and lamps", "ours", 3, CHAMPAGNE, 90, None, True, 0),
        ("furnished 3", "data", 3, None, 0, None, True, 0),
    ],
}

HIDDEN = "001_SPLIT_GLA"

LAMP = """    def SphereLight "more_%d" {
        color3f inputs:color = (%.2f, %.2f, %.2f)
        float inputs:intensity = 1500
        float inputs:radius = 0.05
        double3 xformOp:translate = (%.3f, %.3f, %.3f)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
"""


def run(program, arguments):
    done = subprocess.run([program, "--log-level", "error", *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit("%s %s\n%s" % (program, " ".join(arguments), done.stderr))
    return done.stdout


def facts(options, room, plugins):
    return json.loads(run(options.program, [*plugins, "inspect", "--json", room]))


def nodes_of(tree):
    waiting = list(tree)
    while waiting:
        node = waiting.pop()
        yield node
        waiting += node.get("children", [])


def matrix_of(eye, target):
    back = np.subtract(eye, target)
    back = back / np.linalg.norm(back)
    right = np.cross([0, 0, 1], back)
    right = right / np.linalg.norm(right)
    rows = [[*right, 0], [*np.cross(back, right), 0], [*back, 0], [*eye, 1]]
    return "( " + ", ".join("(" + ", ".join("%.6f" % x for x in r) + ")" for r in rows) + " )"


def overs(branches):
    """USD text that says something else of nodes: branches by name, with the text of their ends."""
    text = ""
    for name, below in branches.items():
        if isinstance(below, dict):
            text += "over \"%s\" {\n%s}\n" % (name, overs(below))
        else:
            text += "over \"%s\" %s\n" % (name, below)
    return text


def write_scene(options, plugins, spec, path):
    """A scene with the room, lights and the camera `bench_camera`."""
    _, owner, number, sky, turn, sun, has_lamps, more = spec
    room = os.path.join(options.assets if owner == "ours" else options.data, ROOMS % number)
    told = facts(options, room, plugins)
    (x0, y0, z0), (x1, y1, z1) = told["bounds_m"]
    middle = [(x0 + x1) / 2, (y0 + y1) / 2]
    target = [*middle, 0.85]
    corner = np.array([x0 + 0.7, y0 + 0.8, 1.6])
    if np.linalg.norm(corner - target) > 4:  # rooms in houses
        corner = np.array(target) + [-2.4, -1.6, 0.75]
    eye = corner + 0.3 * (np.array(target) - corner) + [0, 0, 0.3]
    # Lamps' glasses are hidden, as jobs for these rooms do.
    ends = {n["path"]: "(active = false) {}" for n in nodes_of(told["tree"]) if HIDDEN in n["path"].rsplit("/", 1)[-1]}
    if not has_lamps:
        ends.update({light["path"]: "{\nfloat inputs:intensity = 0\n}" for light in told["lights"]})
    branches = {}
    for place, end in ends.items():
        *way, last = place.strip("/").split("/")[1:]
        branch = branches
        for name in way:
            branch = branch.setdefault(name, {})
            if not isinstance(branch, dict):
                break  # below one that is hidden
        else:
            branch[last] = end
    body = overs(branches)
    text = "#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Z\"\n    subLayers = [@%s@]\n)\n" % os.path.abspath(room)
    text += body
    text += "def Xform \"bench\" {\n"
    text += """    def Camera "bench_camera" {
        float focalLength = 20
        float horizontalAperture = 20.955
        float verticalAperture = 15.716
        float2 clippingRange = (0.01, 1000)
        matrix4d xformOp:transform = %s
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }
""" % matrix_of(eye, target)
    if sky:
        text += """    def DomeLight "sky" {
        float inputs:intensity = 1000
        asset inputs:texture:file = @%s@
        token inputs:texture:format = "latlong"
        float xformOp:rotateZ = %g
        uniform token[] xformOpOrder = ["xformOp:rotateZ"]
    }
""" % (os.path.abspath(os.path.join(options.assets, sky)), turn)
    if sun:
        # Shines along -z of its node.
        text += """    def DistantLight "sun" {
        float inputs:angle = 0.53
        float inputs:intensity = 75000000
        float3 xformOp:rotateXYZ = (%g, 0, %g)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    }
""" % (90 - sun[0], sun[1])
    random = np.random.default_rng(number)
    for i in range(more):
        place = [random.uniform(x0 + 0.4, x1 - 0.4), random.uniform(y0 + 0.4, y1 - 0.4), random.uniform(1.4, 2.4)]
        text += LAMP % (i, *random.uniform(0.4, 1.0, 3), *place)
    with open(path, "w") as out:
        out.write(text + "}\n")


def picture(options, plugins, scene, seed, samples, out):
    told = json.loads(
        run(options.program, [
            *plugins, "bench", "--scene", scene, "--camera", "bench_camera", "--width", "160", "--height", "120", "--set",
            "samples=%d" % samples, "--set", "denoise=false", "--set", "exposure=fixed", "--seed", str(seed), "-o", out,
            "--json", *[x for s in options.parameters for x in ("--set", s)]
        ]))
    image = cv2.imread(out, cv2.IMREAD_UNCHANGED)[..., :3].astype(np.float64)
    return image, told["runs"][0]["render"]["cpu_s"]


def judge(pairs, reference):
    scale = reference**2 + 0.0025 * np.median(reference)**2
    own = np.mean([(0.5 * (a - b)**2 / scale).mean(-1).ravel() for a, b in pairs], axis=0)
    order = np.sort(own)
    return own.mean(), order[:int(len(order) * 0.999)].mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = os.path.dirname(os.path.abspath(__file__))
    parser.add_argument("--program", default=os.path.join(here, "../../build/release/bin/diorama"))
    parser.add_argument("--loaders")
    parser.add_argument("--assets", required=True)
    parser.add_argument("--data")
    parser.add_argument("--now", required=True)
    parser.add_argument("--before")
    parser.add_argument("--set", default="judging", choices=SETS)
    parser.add_argument("--only", default="", help="rooms whose name holds this")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--repetitions", type=int, default=1)
    parser.add_argument("--parameters", nargs="*", default=[], help="of the renderer, KEY=VALUE")
    parser.add_argument("--keep", help="folder for scenes and pictures; default: none is kept")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = options.keep or temporary
        os.makedirs(work, exist_ok=True)
        builds = {"now": options.now}
        if options.before:
            builds["before"] = options.before
        plugins = {
            name: ["--plugin-dir", folder] + (["--plugin-dir", options.loaders] if options.loaders else [])
            for name, folder in builds.items()
        }
        gains = []
        print("| room | variance, trimmed: before, now | CPU s | mean now / before | efficiency now / before, trimmed |")
        print("|---|---|---|---|---|")
        for spec in SETS[options.set]:
            if options.only not in spec[0] or (spec[1] == "data" and not options.data):
                continue
            slug = spec[0].replace(" ", "_").replace(",", "")
            scene = os.path.join(work, slug + ".usda")
            write_scene(options, plugins["now"], spec, scene)
            pairs = {name: [] for name in builds}
            seconds = {name: [] for name in builds}
            for seed in range(options.repetitions):
                for name in builds:
                    taken = []
                    for part in "ab":
                        out = os.path.join(work, "%s_%s_%d%s.exr" % (slug, name, seed, part))
                        image, cpu = picture(options, plugins[name], scene, 2 * seed + ord(part), options.samples, out)
                        taken.append(image)
                        seconds[name].append(cpu)
                    pairs[name].append(taken)
            everything = np.mean([image for pair in pairs.values() for ab in pair for image in ab], axis=0)
            row = {name: judge(pairs[name], everything) for name in builds}
            cpu = {name: statistics.median(seconds[name]) for name in builds}
            means = {name: np.mean([image for ab in pairs[name] for image in ab]) for name in builds}
            order = [name for name in ("before", "now") if name in builds]
            gain = ["", ""]
            ratio = ""
            if "before" in builds:
                both = [row["before"][k] * cpu["before"] / (row["now"][k] * cpu["now"]) for k in (0, 1)]
                gains.append(both)
                gain = ["%.2f" % g for g in both]
                ratio = "%.3f" % (means["now"] / means["before"])
            print("| %s | %s | %s | %s | %s |" %
                  (spec[0], "; ".join("%.4f, %.4f" % row[n] for n in order), "; ".join("%.2f" % cpu[n] for n in order), ratio,
                   ", ".join(gain)), flush=True)
        if gains:
            print("median efficiency now / before: %.2f, trimmed %.2f; worst %.2f, %.2f" %
                  (*np.median(gains, axis=0), *np.min(gains, axis=0)))


if __name__ == "__main__":
    main()
