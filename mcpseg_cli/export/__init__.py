"""What people look at: maps as clouds, object lists, pictures and pages; networks as ONNX."""
