"""Whether the simulator does what a case says: each kind of physics alone on one axis, against what mechanics says of it.

The axis goes to and fro, as `waves` do, without noise or geometry. A line that does not hold ends in status 1.
"""
import numpy as np

from bearing import Bearing
from link import bent
from machine import Machine
from paths import EVERY, STEP, eased
from plant import Bare, Drive, Plant, bodies, gains


def to_and_fro(machine, j, size, period=16.0, seconds=40.0):
    t = np.arange(0, seconds, STEP)
    q = np.zeros((len(t), len(machine.joints)))
    q[:, j] = size * eased(t / 4) * np.sin(2 * np.pi * t / period)
    return t, q


def check(machines):
    rng, bad = np.random.default_rng(1), 0
    machine = Machine(f"{machines}/rotary_axis.ron")
    masses = bodies(rng, machine)
    # Balanced about a vertical axis: nothing but what is put in.
    masses[machine.joints[0].name][1][:] = 0
    bare = Bare(machine, masses)
    inertia = bare.inertia(np.zeros((1, len(machine.joints))))
    t, q = to_and_fro(machine, 0, 0.5)
    rate = np.gradient(q[:, 0], STEP)
    gain = np.gradient(rate, STEP)
    pace, rotor, half = 130.0, 2.0, 40e-6
    most = inertia[0] * np.abs(gain).max()
    steady = (t > 10) & (np.abs(rate) > 0.3 * np.abs(rate).max())

    def run(**what):
        drives = [Drive(pace=pace, rotor=rotor, **what) for _ in machine.joints]
        plant = Plant(machine, machine.none, masses, drives, inertia, np.zeros(3))
        plant.rest(q[0])
        off = plant.drive(plant.controls(q), np.arange(0, len(q), EVERY))[:, 0] - q[::EVERY, 0]
        return off, gains(drives[0], inertia[0])[0]

    def line(what, found, expected, within):
        nonlocal bad
        holds = abs(found - expected) <= within * abs(expected)
        bad += not holds
        print(f"{what:62} {found:12.4g} {expected:12.4g}  {'holds' if holds else 'DOES NOT HOLD'}")
    print(f"{'':62} {'MuJoCo':>12} {'mechanics':>12}")
    s, v, a, k = steady[::EVERY], rate[::EVERY], gain[::EVERY], np.sign(rate[::EVERY])
    off, kp = run()
    line("clean: deviation over acceleration, s2", -(off[s] @ a[s]) / (a[s] @ a[s]), 1 / pace**2, 0.08)
    off, _ = run(play=2 * half, friction=1.5 * most)
    line("play held by friction: half of its width, rad", -(off[s] @ k[s]) / s.sum(), half + 1.5 * most / kp, 0.05)
    off, _ = run(play=2 * half, friction=0.01 * most)
    coasting = s & (np.sign(a) == -k) & (np.abs(a) > 0.3 * np.abs(a).max())
    line("play without friction: braking loads run ahead by half, rad", (off[coasting] @ k[coasting]) / coasting.sum(), half, 0.15)
    spring = inertia[0] * (2 * np.pi * 100) ** 2
    off, _ = run(spring=spring, friction=spring * half)
    wound = spring * half * (1 / spring + 1 / kp)
    line("friction behind a spring: wind-up, rad", -(off[s] @ k[s]) / s.sum(), wound, 0.05)
    turn = np.flatnonzero(np.diff(k) != 0)
    turn = [i for i in turn if t[::EVERY][i] > 10][0]
    taken = next(i for i in range(turn, len(off)) if off[i] * off[turn - 5] < 0 and abs(off[i]) > 0.95 * wound)
    line("the same: way until it is taken up, rad", abs(q[::EVERY, 0][taken] - q[::EVERY, 0][turn]), 2 * wound, 0.35)
    force = kp * half
    off, _ = run(lugre=(force, 1.3 * force, 0.005, force / (half / 2)))
    line("LuGre: lost motion at speed, rad", -(off[s] @ k[s]) / s.sum(), half, 0.1)
    off, _ = run(cogging=(force, 20.0, 0.0))
    wave = np.sin(20 * (q[::EVERY, 0] + off))
    line("cogging: amplitude, rad", 2 * (off[s] @ wave[s]) / s.sum(), half, 0.15)
    off, _ = run(delay=0.003)
    line("delay: deviation over speed, s", -(off[s] @ v[s]) / (v[s] @ v[s]), 0.003, 0.03)
    off, _ = run(forward=0.8)
    line("feed-forward of 80 %: deviation over speed, s", -(off[s] @ v[s]) / (v[s] @ v[s]), 0.2 * 2 * 0.8 / pace, 0.03)
    # Creep under load: at rest after a wind-up the friction holds it.
    q[:] = 0
    q[:, 0] = 0.2 * eased(t / 2)
    off, _ = run(spring=spring, friction=spring * half)
    line("friction at rest: kept after 35 s, share", off[-1] / off[int(2.5 / STEP / EVERY)], 1.0, 0.2)
    print(f"{'':62} {'Exudyn':>12} {'mechanics':>12}")
    t = np.arange(0, 20, 0.02)
    bearing = Bearing(balls=12, pitch=0.08, ball=0.008, preload=1e-5, odd=2e-5, start=0.3)
    middle, cage = bearing.run(t, 2.0 * np.sin(2 * np.pi * t / 20))
    line("bearing: turns of the cage in a turn of the ring", np.polyfit(np.sin(2 * np.pi * t / 20) * 2.0, cage, 1)[0], (bearing.pitch - bearing.ball) / (2 * bearing.pitch), 0.01)
    away = np.angle(np.exp(1j * (np.arctan2(*middle.T[::-1]) - cage - bearing.start)))
    line("the ring gives way from the odd ball, rad", np.abs(away[25:]).mean(), np.pi, 0.02)
    none, force = np.zeros((1, 2)), np.array([[0.0, -100.0]])
    line("link: its end under a force there, m", bent(0.6, 20.0, 1e6, none, force, np.zeros(1))[0, 1], -100 * 0.6**3 / 3e6, 0.01)
    line("link: the same, turned, rad", bent(0.6, 20.0, 1e6, none, force, np.zeros(1))[0, 2], -100 * 0.6**2 / 2e6, 0.01)
    line("link: its end under its own weight, m", bent(0.6, 20.0, 1e6, np.array([[0.0, -9.81]]), 0 * force, np.zeros(1))[0, 1], -20 * 9.81 * 0.6**3 / 8e6, 0.02)
    return bad
