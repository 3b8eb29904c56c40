#pragma once
#include "Renderer.h"
#include "Shape.h"

namespace jacket::demo {

/// Triangles to draw a shape with, in its own frame, without colours. Round shapes are striped so that one can see them
/// turn. Planes have none: they are drawn as Ground.
Surface triangulate(const Shape& shape);

}  // namespace jacket::demo
