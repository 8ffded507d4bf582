"""What must the flow solver meet? Exact, conserved and published quantities, each with a limit written down first.

`exumob verify` runs the cases and prints value, reference, error and limit; the tests run the same cases. Each file
asks one question in its first line, gives its sources and limits, and ends with its cases:

==================  ====================================================================================
file                subject
==================  ====================================================================================
`basins`            still water, sloshing, decaying vortices, iterations of the pressure solver
`frames`            the same flow seen from grids that move and yaw
`waves`             Stokes wave and solitary wave
`far_field`         waves and water that the window's sides send back
`beds`              a given bed: still water, currents, waves, bodies near it
`hydrostatics`      lift of bodies at rest
`added_mass`        accelerated spheres
`momentum`          momentum of the water and impulses of its loads
`moving_bodies`     plunging, noise of the loads, mirror symmetry
`floating`          heave and draught of a floating box
`coupled_spring`    order of the coupling schemes
`coupled`           free bodies coupled to the flow
`coupled_vehicle`   the vehicle with every coupling scheme
`dam_breaks`        dam breaks against measurements
`columns`           drag of columns in a current
`squat`             a slender hull in shallow water
`towing`            resistance of the vehicle, towed or held
`worst_case`        the vehicle against the current: noise, window, step, models
`load_convergence`  the same on three grids
==================  ====================================================================================

The rest is shared: `check` (checks and cases), `cases` (the list), `initial` (tanks), `single_body`, `free_body`,
`measures`, `runs` (captive runs, kept), `uncertainty`.
"""

from exumob.verification.check import Case, Check, absolute, at_least, relative, reported

__all__ = ["Case", "Check", "absolute", "at_least", "relative", "reported"]
