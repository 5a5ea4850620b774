"""The fast model: a tactile array under a soft cover, in MuJoCo, faster than real time.

The model is a chain of operations on vectors with one entry per texel (row-major, x fastest):

    contact force on each texel         `METHODS`       on every n-th physics step             [N]
    -> Butterworth low-pass             `Butterworth`   at the same rate                       [N]
    -> point spread of the cover        `Gaussian`      once per frame, one constant matrix    [N]
    -> noise, characteristic, counts    `Electronics`   once per frame                         [-]
    -> `Frame`                          time of the sample, counts, texel forces, 8-bit image

`Parameters` holds all numbers of one sensor and is stored as a folder (`Parameters.save`, `load`). `fit_gaussian` fits
the point spread to texel forces that the finite-element reference computed.  There are two ways to run the model.  In a
simulation of the user:

    parameters = fastmodel.load("wts-0614-34")                    # or a folder
    fastmodel.recommend_options(spec)                             # solver settings for steady contact forces
    sensor = fastmodel.attach(spec, "fingertip", parameters)      # before compiling
    model = spec.compile(); data = mujoco.MjData(model)
    sensor.bind(model)
    while ...:
        mujoco.mj_step(model, data)
        if sensor.step(data):
            show(sensor.frame().image)

`attach` also accepts a site.  Its argument `replaces` names geoms that the array replaces.  `Sensor.check(model)` lists
what reduces the accuracy of the sensor; `bind` gives these sentences as warnings.

Or as a simulated bench test, in which a weight presses on the array until it rests:

    result = fastmodel.indent(parameters, meshes.Sphere(radius=5e-3), load=4.9)

The contact forces on the texels add up to the weight of the indenter.  After the point spread, the force that no texel
measures is called `outside`.  Two results have no physical meaning: the depth of an object, which follows from the
softness of MuJoCo's contacts and not from the cover; and the distribution of the force of a flat face by `BoxTexels`,
which follows from the number of contact points.  `Foundation` distributes this force by an elastic foundation, and
`CoverContact` by the compliance of the cover.

Every error about a user's input is a `FastModelError`, which is a `ValueError`.
"""

import lazy_loader

# The public names are those of `__init__.pyi`.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
