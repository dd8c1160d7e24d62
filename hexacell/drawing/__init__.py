"""The robot in pictures: shapes in space, a camera, and what draws them as SVG or in characters."""
