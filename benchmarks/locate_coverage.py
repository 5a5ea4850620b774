"""How often the 95 % intervals of `softcover locate` hold the truth of finite-element presses, and what a frame costs.

python benchmarks/locate_coverage.py                 60 presses of one body and 60 pairs on the flat cover of the WTS
python benchmarks/locate_coverage.py --presses 300 --sensor fingertip
python benchmarks/locate_coverage.py --turned        bodies turned about their axis by any angle, as in a grasp

Bodies are balls, boxes and upright cylinders of random size, place and load.  A pair is the sum of two presses that lie
at least two pitches apart.  Frames are read as counts, and as forces with noise alone; noise is 5 mN.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import validation
from meshes import Cover
from validation.resolution.locate import make_locator

#: Noise of a texel [N], and least distance of two bodies over the pitch [-].
NOISE, APART = 5e-3, 2.0


def draw_body(rng: np.random.Generator) -> str:
    """Draw an indenter."""
    a, b = rng.uniform(1.5, 4.5, 2)
    return str(
        rng.choice(
            [f"sphere:radius={1.3 * a:.2f}mm", f"cylinder:radius={a / 2:.2f}mm", f"box:size={a:.2f}mmx{b:.2f}mmx5mm"]
        )
    )


def draw_presses(
    name: str, count: int, seed: int, *, turned: bool = False
) -> list[tuple[np.ndarray, float, np.ndarray]]:
    """Press random bodies; return place [m], load [N] and texel forces [N] of each."""
    (rng, turns), found = (np.random.default_rng(each) for each in (seed, [seed, 1])), []
    sensor = validation.load(name)
    inner = sensor.array.centres[sensor.array.active]
    while len(found) < count:
        load, middle = np.exp(rng.uniform(np.log(0.5), np.log(4.0))), inner[rng.integers(len(inner))]
        aside = rng.uniform(-0.5, 0.5, 2) * np.array(sensor.array.pitch)
        at = middle + (np.append(aside, 0.0) if sensor.array.rows > 1 else 0.0)
        text = ",".join(f"{1e3 * each:.4f}mm" for each in (at[:2] if isinstance(sensor.cover, Cover) else at))
        yaw = f"{turns.uniform(0, 180):.2f}deg" if turned else None
        try:
            pressed = validation.press(sensor, draw_body(rng), load=f"{load:.4f} N", at=text, yaw=yaw, models=("fem",))
        except ValueError as error:
            print("left out:", error)
            continue
        found.append((at, load, pressed.fem.texel_forces[sensor.array.active]))
    return found


def main() -> None:
    """Press, locate and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sensor", default="wts-0614-34")
    parser.add_argument("--presses", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--turned", action="store_true")
    options = parser.parse_args()
    presses = draw_presses(options.sensor, options.presses, options.seed, turned=options.turned)
    sensor, rng = validation.load(options.sensor), np.random.default_rng(options.seed)
    pitch = max(sensor.array.pitch)
    pairs = [(a, b) for a in presses for b in presses if np.linalg.norm(a[0] - b[0]) > APART * pitch]
    chosen = rng.permutation(len(pairs))[: options.presses]
    groups = {1: [(each,) for each in presses], 2: [pairs[each] for each in chosen]}
    for forces in (False, True):
        locator, _ = make_locator(sensor, noise=NOISE, forces=forces)
        for count, cases in groups.items():
            held, errors, widths, times, words = [], [], [], [], 0
            for case in cases:
                exact = sum(each[2] for each in case)[None]
                reading = locator.channel.read(exact, rng.standard_normal(exact.shape))
                locator.find(reading, count)  # prepares the charts
                began = time.process_time()
                frame = locator.find(reading, count)
                times.append(time.process_time() - began)
                if len(frame.touches) < count or any("not" in each for each in frame.words):
                    words += 1
                    continue
                for touch in frame.touches:
                    near = min(
                        case, key=lambda each: np.linalg.norm(each[0] - [touch.x.value, touch.y.value, touch.z.value])
                    )
                    truth = [*near[0][:2], near[1]]
                    told = [touch.x, touch.y, touch.force]
                    held.append([each.low <= value <= each.high for each, value in zip(told, truth, strict=True)])
                    errors.append([each.value - value for each, value in zip(told, truth, strict=True)])
                    widths.append([(each.high - each.low) / 3.92 for each in told])
            share, error, width = (np.asarray(each, float) for each in (held, errors, widths))
            ratio = np.sqrt((error**2).mean(0) / (width**2).mean(0))
            print(
                f"{'forces' if forces else 'counts'}, {count} touch{'es' if count > 1 else ''}: {len(cases)} frames, "
                f"{words} say they are not explained or not told apart; held x, y, force {share.mean(0).round(3)}, all "
                f"{share.mean():.3f}; rms error over sd {ratio.round(2)}; {1e3 * np.median(times):.1f} ms a frame"
            )


if __name__ == "__main__":
    main()
