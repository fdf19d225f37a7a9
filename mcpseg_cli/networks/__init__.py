"""The networks of the paper's tables, and the sparse U-Net that sees the room."""
