"""A System that makes measured depth images of true ones."""

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from prehensile.perception.depth_noise import DepthNoiseConfig, add_depth_noise


class DepthNoise(LeafSystem):
    """Stands between an ideal depth sensor and everything else.

    Ports::

                                        +------------+
        depth_image (ImageDepth32F)  -> | DepthNoise | -> depth_image (ImageDepth32F)
        color_image (ImageRgba8U)    -> |            |
                                        +------------+

    The colour image, of the same pixels, may be left unconnected. Everything is computed when it
    is read. The noise is a function of the seed and of the time in microseconds: the same at the
    same time, however often it is read, and another one at another time.
    """

    def __init__(self, K: NDArray[np.float64], config: DepthNoiseConfig) -> None:
        """Makes the System.

        Args:
            K: (3, 3) intrinsics of the depth camera [pixels].
            config: its faults.
        """
        super().__init__()
        self._K, self._config = np.array(K, dtype=float), config
        self._depth = self.DeclareAbstractInputPort(
            "depth_image", AbstractValue.Make(ImageDepth32F())
        )
        self._color = self.DeclareAbstractInputPort(
            "color_image", AbstractValue.Make(ImageRgba8U())
        )
        self.DeclareAbstractOutputPort(
            "depth_image",
            lambda: AbstractValue.Make(ImageDepth32F()),
            self._calc,
            prerequisites_of_calc={
                self._depth.ticket(),
                self._color.ticket(),
                self.time_ticket(),
            },
        )

    def _calc(self, context: Context, value: AbstractValue) -> None:
        depth = self._depth.Eval(context).data[:, :, 0]
        color = self._color.Eval(context).data if self._color.HasValue(context) else None
        time = int(np.rint(1e6 * context.get_time())) % 2**63
        rng = np.random.default_rng([self._config.seed, time])
        measured = add_depth_noise(depth, self._K, self._config, rng, color)
        image = ImageDepth32F(depth.shape[1], depth.shape[0])
        image.mutable_data[:, :, 0] = measured
        value.set_value(image)
