"""SGPN, similarity group proposal network (Wang et al. 2018), on PointNet features (tables I and II).

Its objects are clustered like MCPNet's, by the cosine similarity of its similarity features, as in
the paper (IV-B). These have as many dimensions as MCPNet's embedding, so that the same map holds
them.
"""

from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.config import EMBEDDING, SGPN_SIMILARITY
from mcpseg_cli.networks.network import Network, NetworkOutput, initialise, perceptron
from mcpseg_cli.networks.pointnet import JOINT_WIDTHS, PointFeatures

_HIDDEN = 64  # of the class and the confidence branch


class SGPN(Network):
    """Joint class and instance network with a similarity, a class and a confidence branch.

    Args:
        num_classes: C, classes to tell apart.
    """

    has_embedding = True
    similarity = SGPN_SIMILARITY

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        width = JOINT_WIDTHS[-1]
        self.features = PointFeatures()
        self.embed = perceptron(width, EMBEDDING)
        self.classify = nn.Sequential(
            nn.Linear(width, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, num_classes)
        )
        self.confide = nn.Sequential(nn.Linear(width, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, 1))
        self.apply(initialise)

    def outputs(self, centre: Tensor, context: Tensor | None = None) -> NetworkOutput:
        """Give all three branches; see ``Network``."""
        features, logits, confidence = self.branches(centre)
        embedding = functional.normalize(features.float(), dim=-1, eps=1e-6)
        return NetworkOutput(embedding, logits, features, confidence)

    def branches(self, centre: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Give what its losses need.

        Args:
            centre: (N, 6) or (B, N, 6).

        Returns:
            (..., N, E) similarity features, not normalised: their squared distances fill the
            similarity matrix. (..., N, C) class logits. (..., N) confidence: the overlap expected
            of a point's group with its object, 0 to 1.
        """
        features = self.features(centre)
        return self.embed(features), self.classify(features), self.confide(features).squeeze(-1)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Embed and classify points; see ``Network``."""
        similarity, logits, _ = self.branches(centre)
        return functional.normalize(similarity, dim=-1, eps=1e-6), logits
