#pragma once
#include <string>
#include <string_view>
#include <variant>

#include "jacket/models/BaraffWitkinMembrane.h"
#include "jacket/models/CubicShellBending.h"
#include "jacket/models/DihedralBending.h"
#include "jacket/models/DihedralDifferenceBending.h"
#include "jacket/models/PatchBending.h"
#include "jacket/models/QuadraticBending.h"
#include "jacket/models/SpringMembrane.h"
#include "jacket/models/StVenantKirchhoffMembrane.h"

namespace jacket {

/// The registration lines. A model named here can be chosen in ShellOptions and in scene files, and is tested.
using MembraneModel = std::variant<StVenantKirchhoffMembrane, BaraffWitkinMembrane, SpringMembrane>;
using BendingModel =
    std::variant<PatchBending, DihedralBending, DihedralDifferenceBending, QuadraticBending, CubicShellBending>;

}  // namespace jacket
