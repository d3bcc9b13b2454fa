"""What a model is told of a scene: text of the task, tables of its bodies, pictures and measured heights."""
