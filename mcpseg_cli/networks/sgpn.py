"""SGPN, similarity group proposal network (Wang et al. 2018), on PointNet features (tables I, II).

Its objects are clustered like MCPNet's, by the cosine similarity of its similarity features, as in
the paper (IV-B). These have as many dimensions as MCPNet's embedding, so that the same map holds
them.
"""

from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.networks.description import TRAITS
from mcpseg_cli.networks.network import Branches, Network, initialise, perceptron
from mcpseg_cli.networks.pointnet import JOINT_WIDTHS, PointFeatures

_HIDDEN = 64  # of the class and the confidence branch


class SGPN(Network):
    """Joint class and instance network with a similarity, a class and a confidence branch.

    Args:
        num_classes: C, classes to tell apart.
    """

    traits = TRAITS["sgpn"]

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

    def branches(self, centre: Tensor, context: Tensor | None = None) -> Branches:
        """Give what its losses need; see ``Network``."""
        features = self.features(centre)
        similarity = self.embed(features)
        embedding = functional.normalize(similarity.float(), dim=-1, eps=1e-6)
        confidence = self.confide(features).squeeze(-1)
        return Branches(embedding, self.classify(features), similarity, confidence)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[Tensor | None, Tensor]:
        """Embed and classify points; see ``Network``."""
        branches = self.branches(centre)
        return branches.embedding, branches.logits
