#pragma once
#include <array>
#include <limits>
#include <type_traits>

#include "energy/ColouredRanges.h"
#include "energy/Energy.h"
#include "energy/TriangleKernel.h"

namespace jacket {

/// The one loop over the stencils of a model: a virtual call per energy and step, none per stencil.
template <StencilModel Model>
class StencilEnergy final : public Energy {
    static constexpr int N = Model::kVertices;
    using Vertices = std::array<int, N>;
    using Slots = std::array<int, N*(N - 1) / 2>;

  public:
    /// Stencils of one material.
    struct Group {
        Model model;
        YieldRule yield;  ///< infinite: elastic
        std::vector<Vertices> stencils;
        std::vector<double> areas;
        std::vector<int> triangles;  ///< the first at each stencil's site
        bool canYield() const {
            return std::isfinite(Model::kSite == StencilSite::Triangle ? yield.tension : yield.curvature);
        }
    };

    StencilEnergy(std::vector<Group> groups, const RestShape& rest) : m_groups(std::move(groups)) {
        m_rest.resize(m_groups.size());
        m_slots.resize(m_groups.size());
        m_ranges.resize(m_groups.size());
        m_accumulated.resize(m_groups.size());
        for (std::size_t g = 0; g < m_groups.size(); ++g) {
            Group& group = m_groups[g];
            m_rest[g].reserve(group.stencils.size());
            for (std::size_t i = 0; i < group.stencils.size(); ++i)
                m_rest[g].push_back(group.model.rest(atRest(rest, group.stencils[i]), group.areas[i]));
            if (group.canYield()) continue;
            group.areas = std::vector<double>();  // gives its memory back, which {} does not
            group.triangles = std::vector<int>();
        }
    }

    void collectPairs(std::vector<std::pair<int, int>>& pairs) const override {
        for (const auto& group : m_groups)
            for (const auto& stencil : group.stencils)
                for (int a = 0; a < N; ++a)
                    for (int b = 0; b < a; ++b) pairs.emplace_back(stencil[a], stencil[b]);
    }

    void bind(const BlockMatrix& matrix) override {
        for (std::size_t g = 0; g < m_groups.size(); ++g) {
            m_slots[g].clear();
            m_slots[g].reserve(m_groups[g].stencils.size());
            for (const auto& stencil : m_groups[g].stencils) m_slots[g].push_back(stencilSlots<N>(matrix, stencil));
            if constexpr (TriangleTermModel<Model>) m_ranges[g] = ColouredRanges(m_groups[g].stencils);
        }
    }

    void addTo(StepSystem& system, const Points& x, HessianKind kind) const override {
        for (std::size_t g = 0; g < m_groups.size(); ++g) {
            const Group& group = m_groups[g];
            if constexpr (TriangleTermModel<Model>)
                if (kind == HessianKind::Positive) {
                    m_ranges[g].run(system.team(), [&, sink = system.sink()](int begin, int end) {
                        addTriangles<Model>(triangles(g), begin, end, x.data(), sink);
                    });
                    continue;
                }
            for (std::size_t i = 0; i < group.stencils.size(); ++i) {
                const Stencil<N> xs = gather(x, group.stencils[i]);
                StencilEval<N> term = group.model.evaluate(xs, m_rest[g][i], kind);
                if constexpr (requires { group.model.predictedStress(xs, xs, m_rest[g][i]); })
                    if (kind == HessianKind::Exact && !m_stress.empty()) {
                        const Mat2 missing =
                            m_stress[g][i] - group.model.predictedStress(xs, Stencil<N>::Zero(), m_rest[g][i]);
                        term.hessian += timesIdentity3<N>(group.model.geometricHessian(missing, m_rest[g][i]));
                    }
                system.add<N>(group.stencils[i], m_slots[g][i], term);
            }
            if constexpr (DampedStencilModel<Model>) {
                if (!group.model.isDamped()) continue;
                for (std::size_t i = 0; i < group.stencils.size(); ++i)
                    system.addDamping<N>(group.stencils[i], m_slots[g][i],
                                         group.model.damping(gather(x, group.stencils[i]), m_rest[g][i]));
            }
        }
    }

    double value(const Points& x) const override {
        double sum = 0.0;
        for (std::size_t g = 0; g < m_groups.size(); ++g)
            if constexpr (TriangleTermModel<Model>)
                sum += energyOfTriangles<Model>(triangles(g), x.data());
            else
                for (std::size_t i = 0; i < m_groups[g].stencils.size(); ++i) sum += valueOf(g, i, x);
        return sum;
    }

    void addGradient(const Points& x, Points& gradient) const override {
        for (std::size_t g = 0; g < m_groups.size(); ++g) {
            const Group& group = m_groups[g];
            for (std::size_t i = 0; i < group.stencils.size(); ++i) {
                const auto term =
                    group.model.evaluate(gather(x, group.stencils[i]), m_rest[g][i], HessianKind::Positive);
                for (int a = 0; a < N; ++a) gradient.col(group.stencils[i][a]) += term.gradient.col(a);
            }
        }
    }

    void predictStress(const Points& x, const Points& dx) override {
        if constexpr (requires(Model m, Stencil<N> s, typename Model::Rest r) { m.predictedStress(s, s, r); }) {
            m_stress.clear();
            if (dx.cols() == 0) return;
            m_stress.resize(m_groups.size());
            for (std::size_t g = 0; g < m_groups.size(); ++g)
                for (std::size_t i = 0; i < m_groups[g].stencils.size(); ++i) {
                    const auto& stencil = m_groups[g].stencils[i];
                    m_stress[g].push_back(
                        m_groups[g].model.predictedStress(gather(x, stencil), gather(dx, stencil), m_rest[g][i]));
                }
        }
    }

    PlasticFlow flow(const Points& x) override {
        PlasticFlow result;
        if constexpr (PlasticStencilModel<Model>)
            for (std::size_t g = 0; g < m_groups.size(); ++g) flowOf(g, x, result);
        return result;
    }

  private:
    TriangleList<typename Model::Rest> triangles(std::size_t g) const requires TriangleTermModel<Model> {
        return {m_groups[g].stencils.data(), m_slots[g].data(), m_rest[g].data(),
                static_cast<int>(m_groups[g].stencils.size())};
    }

    static Stencil<N> gather(const Points& x, const Vertices& vertices) {
        Stencil<N> xs;
        for (int a = 0; a < N; ++a) xs.col(a) = x.col(vertices[a]);
        return xs;
    }

    static Stencil<N> atRest(const RestShape& rest, const Vertices& vertices) {
        Stencil<N> xs = gather(rest.positions, vertices);
        if constexpr (Model::kSite == StencilSite::Hinge)
            if (rest.flattened) {  // turn the second triangle about the edge into the first one's plane
                const Vec3 axis = (xs.col(1) - xs.col(0)).normalized(), a = xs.col(2) - xs.col(0);
                const Vec3 b = xs.col(3) - xs.col(0), across = (a - a.dot(axis) * axis).normalized();
                xs.col(3) = xs.col(0) + b.dot(axis) * axis - (b - b.dot(axis) * axis).norm() * across;
            }
        return xs;
    }

    double valueOf(std::size_t g, std::size_t i, const Points& x) const {
        const Model& model = m_groups[g].model;
        const Stencil<N> xs = gather(x, m_groups[g].stencils[i]);
        if constexpr (requires { model.energy(xs, m_rest[g][i]); })
            return model.energy(xs, m_rest[g][i]);
        else
            return model.evaluate(xs, m_rest[g][i], HessianKind::Positive).energy;
    }

    void flowOf(std::size_t g, const Points& x, PlasticFlow& result) {
        const Group& group = m_groups[g];
        if (!group.canYield()) return;
        m_accumulated[g].resize(group.stencils.size(), 0.0);
        for (std::size_t i = 0; i < group.stencils.size(); ++i) {
            typename Model::Rest moved = m_rest[g][i];
            if (!group.model.flow(gather(x, group.stencils[i]), group.areas[i], group.yield, moved,
                                  m_accumulated[g][i]))
                continue;
            const double before = valueOf(g, i, x);
            m_rest[g][i] = moved;
            result.add(before - valueOf(g, i, x), group.triangles[i]);
        }
    }

    std::vector<Group> m_groups;
    std::vector<std::vector<typename Model::Rest>> m_rest;
    std::vector<std::vector<Slots>> m_slots;
    std::vector<ColouredRanges> m_ranges;            ///< of models whose terms are computed several at a time
    std::vector<std::vector<Mat2>> m_stress;         ///< predicted; empty outside Newton's method for statics
    std::vector<std::vector<double>> m_accumulated;  ///< plastic strain; empty until something is asked to flow
};

}  // namespace jacket
