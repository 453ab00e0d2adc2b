"""The layered block of the kernel's benchmark with akantu: element updates per second of one core.

CPU seconds of this thread, so that a busy machine does not count. Explicit central differences, lumped mass,
four-point quads (akantu has no one-point quad).
    pip install akantu numpy meshio gmsh
    python akantu_block.py
"""
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import akantu as aka
import numpy as np

NX, NY, WIDTH, HEIGHT, STEPS = 25, 60, 500e-6, 2700e-6, 1000

with open("akantu_block.dat", "w") as f:
    for name, young in (("corneum", 28.3e6), ("dermis", 1.5e6), ("soft", 0.02e6)):
        f.write(f"material elastic [\n name = {name}\n rho = 750\n E = {young}\n nu = 0.33\n"
                " Plane_Stress = false\n]\n")
aka.parseInput("akantu_block.dat")

nodes = np.array([[WIDTH * i / NX, HEIGHT * j / NY] for j in range(NY + 1) for i in range(NX + 1)])
quads = np.array([[j * (NX + 1) + i, j * (NX + 1) + i + 1, (j + 1) * (NX + 1) + i + 1, (j + 1) * (NX + 1) + i]
                  for j in range(NY) for i in range(NX)])
heights = nodes[quads].mean(axis=1)[:, 1]
layer = np.where(heights < 300e-6, 1, np.where(heights < 900e-6, 2, 3))
with open("akantu_block.msh", "w") as f:
    f.write('$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n'
            '2 1 "corneum"\n2 2 "dermis"\n2 3 "soft"\n$EndPhysicalNames\n')
    f.write(f"$Nodes\n{len(nodes)}\n" + "".join(f"{n + 1} {x} {y} 0\n" for n, (x, y) in enumerate(nodes)))
    f.write(f"$EndNodes\n$Elements\n{len(quads)}\n")
    for n, (quad, tag) in enumerate(zip(quads, layer)):
        f.write(f"{n + 1} 3 2 {tag} {tag} " + " ".join(str(q + 1) for q in quad) + "\n")
    f.write("$EndElements\n")
mesh = aka.Mesh(2)
mesh.read("akantu_block.msh")
nodes = mesh.getNodes()
model = aka.SolidMechanicsModel(mesh)
selector = aka.MeshDataMaterialSelectorString("physical_names", model)
model.setMaterialSelector(selector)
model.initFull(_analysis_method=aka._explicit_lumped_mass)
model.getBlockedDOFs()[nodes[:, 1] > HEIGHT * (1 - 1e-9)] = True
bottom = nodes[:, 1] < 1e-12
model.getExternalForce()[bottom, 1] = 7e3 * WIDTH / bottom.sum()
model.setTimeStep(0.5 * model.getStableTimeStep())
start = time.process_time()
for _ in range(STEPS):
    model.solveStep()
seconds = time.process_time() - start
assert np.isfinite(model.getDisplacement()).all()
print(f"akantu: {NX * NY * STEPS / seconds / 1e6:.2f} million element updates/s")
