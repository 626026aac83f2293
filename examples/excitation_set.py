"""A set of trajectories to execute on an arm, from its description alone, and the motion to send to it."""

import sidegan as sg

cell = sg.Cell("planar2", harmonics=4, period=8)  # or the path of a URDF, xacro or MJCF file
for text in (*cell.warnings, *cell.notes):
    print(text)

excitation = sg.excite(cell, count=3, seed=0, search={"evaluations": 100})
print(f"{len(excitation)} trajectories, condition number {excitation.condition:.3g}")
print(excitation.demands().to_string())

motion = excitation.motion(rate=100)  # position, velocity and acceleration, (3, T, J) each
print("the first ends at", motion.position[0, -1], "after", motion.time[-1], "s")
