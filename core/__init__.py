"""VLMgineer's framework: the types, the interfaces and the loop. It knows no engine, no model and no task."""
