"""Settings of the training of posterior networks."""

from __future__ import annotations

from dataclasses import dataclass

from .posterior_artifact import Network


@dataclass(frozen=True, kw_only=True)
class Training:
    """Settings of the training.

    Attributes
    ----------
    samples, windows : int
        Samples of a window, and how many of them.
    block, components : int
        Samples that are averaged, and principal components.
    network : {"perceptron", "neuro-fuzzy"}
        A multilayer perceptron, or the thesis' network with indices that are trained.
    references : int
        Reference cases of a neuro-fuzzy network.
    hidden, latent, inner : int
        Values of each hidden layer of the perceptron, latent values that the decoder gets beside the damage, and values of
        its hidden layer.
    virtual : float
        Share of the cases that are moved to other damages until the last quarter of the epochs; see ``Fit.epoch``.
    spoilt : float
        Share of the records with a wrong sensor, so that the network is not sure of its answer where it sees one.
    epochs, batch : int
        Passes of the network through the cases, and cases of a step.
    rate : float
        First step size of Adam; it falls to 0 along half a cosine.
    held_out : float
        Share of the cases, the last ones, that limits and errors come from: half for each.
    seed : int
        Of weights, order, gain and noise.
    """

    samples: int = 844
    windows: int = 3
    block: int = 2
    components: int = 128
    network: Network = "neuro-fuzzy"
    references: int = 256
    hidden: int = 128
    latent: int = 8
    inner: int = 96
    epochs: int = 150
    virtual: float = 0.9
    spoilt: float = 0.03
    batch: int = 256
    rate: float = 2e-3
    held_out: float = 0.15
    seed: int = 0

    @property
    def decoder_epochs(self) -> int:
        """Passes of the decoder through the cases."""
        return 1 + self.epochs // 4
