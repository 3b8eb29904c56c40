#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "Json.h"
#include "jacket/Models.h"

/// Models as scene files spell them. The names come from the registration lines in jacket/Models.h.
namespace jacket::demo {

template <class... Models>
std::vector<std::string> modelNames(const std::variant<Models...>*) {
    return {std::string(Models::kName)...};
}

/// The registered model of that name; throws InputError, or NotAvailable for one that is planned.
template <class Variant>
Variant modelByName(const std::string& name, const std::string& label) {
    Variant result;
    const bool found = [&]<class... Models>(const std::variant<Models...>*) {
        return ((Models::kName == name ? (result = Models{}, true) : false) || ...);
    }(static_cast<const Variant*>(nullptr));
    if (found) return result;
    const auto names = modelNames(static_cast<const Variant*>(nullptr));
    throw InputError(label + ": unknown model \"" + name + "\"" + suggestion(name, names));
}

/// Calls visit(key, member, range) for each parameter of a model that a scene file can set.
template <class Model, class Visit>
void forEachParameter(Model& model, Visit&& visit) {
    if constexpr (requires { model.stretchStiffness; })
        visit("stretch_stiffness", model.stretchStiffness, Range::nonNegative("N/m"));
    if constexpr (requires { model.weftStiffness; })
        visit("weft_stiffness", model.weftStiffness, Range::nonNegative("N/m"));
    if constexpr (requires { model.shearStiffness; })
        visit("shear_stiffness", model.shearStiffness, Range::nonNegative("N/m"));
    if constexpr (requires { model.stretchU; }) visit("stretch_u", model.stretchU, Range::nonNegative("N/m"));
    if constexpr (requires { model.stretchV; }) visit("stretch_v", model.stretchV, Range::nonNegative("N/m"));
    if constexpr (requires { model.shear; }) visit("shear", model.shear, Range::nonNegative("N/m"));
    if constexpr (requires { model.bU; }) visit("b_u", model.bU, Range::positive(""));
    if constexpr (requires { model.bV; }) visit("b_v", model.bV, Range::positive(""));
    if constexpr (requires { model.conditionDamping; })
        visit("condition_damping", model.conditionDamping, Range::nonNegative("N s/m"));
    if constexpr (requires { model.areaSquared; }) visit("area_squared", model.areaSquared, Range::any());
    if constexpr (requires { model.warp; }) visit("warp", model.warp, Range::any());
    if constexpr (requires { model.compression; }) visit("compression", model.compression, Range::any());
    if constexpr (requires { model.poisson; })
        visit("poisson", model.poisson, Range{.low = -1, .includesLow = false, .high = 0.5});
    if constexpr (requires { model.stiffness; }) visit("stiffness", model.stiffness, Range::nonNegative("N m"));
}

template <class Model>
void readParameters(ObjectReader& in, Model& model) {
    forEachParameter(model, [&](std::string_view key, auto& member, const Range& range) {
        using Member = std::remove_cvref_t<decltype(member)>;
        if (!in.has(key)) return;
        if constexpr (std::is_same_v<Member, bool>)
            member = in.flag(key, member);
        else if constexpr (std::is_same_v<Member, std::optional<Vec3>>)
            member = in.vector(key);
        else
            member = in.number(key, range);
    });
}

/// {"model": name, parameters that are set ...}
template <class Variant>
Json modelToJson(const Variant& variant) {
    return std::visit(
        [](const auto& model) {
            Json json{{"model", model.kName}};
            forEachParameter(model, [&](std::string_view key, const auto& member, const Range&) {
                using Member = std::remove_cvref_t<decltype(member)>;
                if constexpr (std::is_same_v<Member, std::optional<double>>) {
                    if (member) json[std::string(key)] = *member;
                } else if constexpr (std::is_same_v<Member, std::optional<Vec3>>) {
                    if (member) json[std::string(key)] = toJson(*member);
                } else {
                    json[std::string(key)] = member;
                }
            });
            return json;
        },
        variant);
}

}  // namespace jacket::demo
