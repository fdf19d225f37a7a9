"""The networks by name: what is a fact of an architecture can be asked without building one."""

from mcpseg_cli.choices import Architecture
from mcpseg_cli.networks.mcpnet import MCPNet, MCPNetNoContext
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.pointnet import PointNet
from mcpseg_cli.networks.pointnet2 import PointNet2
from mcpseg_cli.networks.sgpn import SGPN
from mcpseg_cli.networks.voxnet import VoxNet

_NETWORKS: dict[Architecture, type[Network]] = {
    "mcpnet": MCPNet,
    "mcpnet-nocontext": MCPNetNoContext,
    "pointnet": PointNet,
    "pointnet2": PointNet2,
    "sgpn": SGPN,
    "voxnet": VoxNet,
}


def network_type(architecture: Architecture) -> type[Network]:
    """Return the class of a network; calling it with the number of classes builds one.

    Its attributes are the facts: ``network_type("sgpn").batch_size``, and ``needs_context``,
    ``has_embedding`` and ``similarity`` likewise; see ``Network``.
    """
    return _NETWORKS[architecture]
