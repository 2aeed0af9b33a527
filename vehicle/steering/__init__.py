"""The steering system: column, electric power steering, margins of its loop."""
