#pragma once
#include "accuracy/SheetMeshes.h"

namespace jacket::test {
using demo::accuracy::kMeshKinds;
using demo::accuracy::MeshKind;
using demo::accuracy::nameOf;
using demo::accuracy::sheet;
using demo::accuracy::verticesWhere;
}  // namespace jacket::test
