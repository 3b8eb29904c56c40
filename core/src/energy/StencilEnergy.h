#pragma once
#include <array>
#include <type_traits>

#include "energy/Energy.h"

namespace jacket {

/// The one loop over the stencils of a model: a virtual call per energy and step, none per stencil.
template <StencilModel Model>
class StencilEnergy final : public Energy {
    static constexpr int N = Model::kVertices;
    using Vertices = std::array<int, N>;
    using Slots = std::array<int, N*(N - 1) / 2>;

  public:
    StencilEnergy(const Model& model, std::vector<Vertices> stencils, const std::vector<double>& areas,
                  const Points& rest)
        : m_model(model), m_stencils(std::move(stencils)) {
        m_rest.reserve(m_stencils.size());
        for (std::size_t i = 0; i < m_stencils.size(); ++i)
            m_rest.push_back(m_model.rest(gather(rest, m_stencils[i]), areas[i]));
    }

    void collectPairs(std::vector<std::pair<int, int>>& pairs) const override {
        for (const auto& stencil : m_stencils)
            for (int a = 0; a < N; ++a)
                for (int b = 0; b < a; ++b) pairs.emplace_back(stencil[a], stencil[b]);
    }

    void bind(const BlockMatrix& matrix) override {
        m_slots.clear();
        m_slots.reserve(m_stencils.size());
        for (const auto& stencil : m_stencils) m_slots.push_back(stencilSlots<N>(matrix, stencil));
    }

    void addTo(StepSystem& system, const Points& x) const override {
        for (std::size_t i = 0; i < m_stencils.size(); ++i)
            system.add<N>(m_stencils[i], m_slots[i],
                          m_model.evaluate(gather(x, m_stencils[i]), m_rest[i], HessianKind::Positive));
        if constexpr (DampedStencilModel<Model>) {
            if (!m_model.isDamped()) return;
            for (std::size_t i = 0; i < m_stencils.size(); ++i)
                system.addDamping<N>(m_stencils[i], m_slots[i], m_model.damping(gather(x, m_stencils[i]), m_rest[i]));
        }
    }

    double value(const Points& x) const override {
        double sum = 0.0;
        for (std::size_t i = 0; i < m_stencils.size(); ++i) {
            const Stencil<N> xs = gather(x, m_stencils[i]);
            if constexpr (requires { m_model.energy(xs, m_rest[i]); })
                sum += m_model.energy(xs, m_rest[i]);
            else
                sum += m_model.evaluate(xs, m_rest[i], HessianKind::Positive).energy;
        }
        return sum;
    }

    void addGradient(const Points& x, Points& gradient) const override {
        for (std::size_t i = 0; i < m_stencils.size(); ++i) {
            const auto term = m_model.evaluate(gather(x, m_stencils[i]), m_rest[i], HessianKind::Positive);
            for (int a = 0; a < N; ++a) gradient.col(m_stencils[i][a]) += term.gradient.col(a);
        }
    }

  private:
    static Stencil<N> gather(const Points& x, const Vertices& vertices) {
        Stencil<N> xs;
        for (int a = 0; a < N; ++a) xs.col(a) = x.col(vertices[a]);
        return xs;
    }

    Model m_model;
    std::vector<Vertices> m_stencils;
    std::vector<typename Model::Rest> m_rest;
    std::vector<Slots> m_slots;
};

}  // namespace jacket
