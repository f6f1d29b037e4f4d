"""The interfaces that plugins implement, one small file each.

Who calls whom, in the order of a run:

family   → `ActuatorFamily.problem`, `.mass`        a design becomes a boundary-value problem and masses
material → `Material.evaluate`                      strain energy, stress and tangent of a deformation gradient
fem      → `FEMBackend.solver`                      solved states with exact slopes
surrogate→ `Surrogate.fit`                          states become a law τ(p, u)
effect   → `Effect.apply`                           a model becomes a model with one more physical effect
physics  → `PhysicsBackend.build`                   a chain becomes a simulation
task     → `Task.run`                               a simulation becomes metrics
viewer   → `Viewer.pictures`, `.show`               motions become pictures

A package adds an interface by the hook `pliant_interfaces`, as `optimizer` is added.

Every implementation is built by ``Class(config)`` with its own validated, frozen config model, a subclass of
`pliant.interfaces.base.ComponentConfig`.
"""
