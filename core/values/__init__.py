"""What passes between the rooms, typed: tools, plans, jobs, observations, joints, materials, messages."""
