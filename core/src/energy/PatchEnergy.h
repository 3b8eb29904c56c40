#pragma once
#include "energy/Energy.h"
#include "energy/PatchFit.h"

namespace jacket {

/// PatchBending over a whole shell.
class PatchEnergy final : public Energy {
  public:
    /// What one triangle is made of.
    struct Plate {
        double stiffness, poisson;         ///< D [N m], nu
        double yieldCurvature, hardening;  ///< [1/m], infinite: elastic; ratio H / E [-]
    };
    /// `plates`: one for each triangle. Triangles that can yield get a wider matrix, as curved ones have.
    PatchEnergy(const HalfEdgeMesh& mesh, const RestShape& rest, std::vector<Plate> plates);

    void collectPairs(std::vector<std::pair<int, int>>& pairs) const override;
    void bind(const BlockMatrix& matrix) override;
    const ConstantHessian* constantHessian() const override { return &m_constant; }
    void addTo(StepSystem& system, const Points& x, HessianKind kind) const override;
    double value(const Points& x) const override;
    void addGradient(const Points& x, Points& gradient) const override;
    PlasticFlow flow(const Points& x) override;

    /// h_ab . n - b_ab of a triangle [1/m]: uu, vv, uv in its own rest frame.
    Vec3 bendingStrain(int triangle, const Points& x) const;
    const Vec3& restCurvature(int triangle) const { return m_elements[triangle].curvature; }

  private:
    struct Element {
        std::vector<int> vertices;      ///< the triangle's own come first
        SecondDerivatives rows;         ///< B per vertex; unused where `mirrored` is set
        Vec3 curvature = Vec3::Zero();  ///< b: uu, vv, uv [1/m]
        double area = 0.0;              ///< at rest [m^2]
        int mirrored = -1;              ///< index in m_mirrored, or -1
        double accumulated = 0.0;       ///< plastic curvature so far [1/m]
    };
    /// A patch that sees vertices in a mirror: their images' second derivatives are no longer scalars.
    struct Mirrored {
        Eigen::Matrix<double, 9, Eigen::Dynamic> rows;  ///< uu, vv, uv vectors from 3 coordinates per vertex
        Eigen::Matrix<double, 9, 1> offset;
        Eigen::MatrixXd hessian;
    };
    using Vectors = Eigen::Matrix<double, 3, 3>;  ///< columns uu, vv, uv

    std::size_t columnsOf(std::size_t triangle) const;
    Mat3 plateMatrix(int triangle) const;  ///< D A C [N m^3]
    void setUp(int triangle, const MirroredMesh& mesh, const Patch& patch, const RestShape& rest);
    void assembleConstant(int vertexCount);
    Vectors derivatives(const Element& e, const Points& x) const;
    Vectors residual(const Element& e, const Points& x, const Vec3& normal) const;
    double valueOf(int triangle, const Points& x) const;
    void addElementGradient(int triangle, const Points& x, Points& gradient) const;
    void addMirrored(int triangle, StepSystem& system, const Points& x, Points& gradient) const;
    void addNormalTerms(int triangle, StepSystem& system, const Points& x, HessianKind kind, Points& gradient) const;

    std::vector<Plate> m_plates;
    std::vector<Element> m_elements;
    std::vector<Mirrored> m_mirrored;
    ConstantHessian m_constant;
    std::vector<std::vector<int>> m_slots;  ///< of pairs (vertex, corner), or of all pairs of a mirrored patch
};

}  // namespace jacket
