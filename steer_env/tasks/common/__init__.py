"""What tasks share: their declaration, terms of reward and cost, path following, scripted inputs."""
