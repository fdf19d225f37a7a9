"""What people look at: a labelled map as clouds, object lists, pictures and pages, and networks as ONNX."""
