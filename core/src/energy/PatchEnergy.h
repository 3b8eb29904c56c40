#pragma once
#include "energy/Energy.h"
#include "energy/PatchFit.h"

namespace jacket {

/// Unit normal of a triangle, and how it turns: moving corner j by d adds -slope_j (n . d).
struct TriangleNormal {
    Vec3 n;
    Mat3 slopes;  ///< gradients of the corners' hat functions, a column each [1/m]
};

/// PatchBending over a whole shell.
class PatchEnergy final : public Energy {
  public:
    /// What one triangle is made of.
    struct Plate {
        double stiffness, poisson;         ///< D [N m], nu
        double yieldCurvature, hardening;  ///< [1/m], infinite: elastic; ratio H / E [-]
    };
    /// `plates`: one for each triangle. Triangles that can yield get a wider matrix, as curved ones have.
    PatchEnergy(const HalfEdgeMesh& mesh, const RestShape& rest, const std::vector<Plate>& plates);

    void collectPairs(std::vector<std::pair<int, int>>& pairs) const override;
    void bind(const BlockMatrix& matrix) override;
    const ConstantHessian* constantHessian() const override { return &m_constant; }
    void addTo(StepSystem& system, const Points& x, HessianKind kind) const override;
    double value(const Points& x) const override;
    double valueBeside(const Points& x, std::vector<double>& memory) const override;
    void addGradient(const Points& x, Points& gradient) const override;
    PlasticFlow flow(const Points& x) override;

    /// h_ab . n - b_ab of a triangle [1/m]: uu, vv, uv in its own rest frame. Not of shells that are flat for good:
    /// they keep nothing of their triangles but the constant Hessian.
    Vec3 bendingStrain(int triangle, const Points& x) const;
    const Vec3& restCurvature(int triangle) const { return elementOf(triangle).curvature; }

  private:
    /// A triangle's patch. Its lists lie one behind the other with those of all others.
    struct Element {
        int triangle;
        int vertices = 0, vertexCount = 0;  ///< where in m_vertices; the triangle's own come first
        int rows = 0;                       ///< where in m_rows; unused where `mirrored` is set
        int slots = 0;                      ///< where in m_slots
        int mirrored = -1;                  ///< index in m_mirrored, or -1
        Plate plate;
        double area = 0.0;              ///< at rest [m^2]
        double accumulated = 0.0;       ///< plastic curvature so far [1/m]
        Vec3 curvature = Vec3::Zero();  ///< b: uu, vv, uv [1/m]
        Mat3 plateMatrix() const;       ///< D A C [N m^3]
        bool isCurved() const { return !curvature.isZero(0.0); }
        bool canYield() const;
    };
    /// A patch that sees vertices in a mirror: their images' second derivatives are no longer scalars.
    struct Mirrored {
        Eigen::Matrix<double, 9, Eigen::Dynamic> rows;  ///< uu, vv, uv vectors from 3 coordinates per vertex
        Eigen::Matrix<double, 9, 1> offset;
        std::vector<Mat3> hessian;  ///< blocks (i, j), i >= j, by columns
    };
    using Vectors = Eigen::Matrix<double, 3, 3>;  ///< columns uu, vv, uv

    const Element& elementOf(int triangle) const;
    const int* verticesOf(const Element& e) const { return m_vertices.data() + e.vertices; }
    const Vec3* rowsOf(const Element& e) const { return m_rows.data() + e.rows; }
    int columnsOf(const Element& e) const;
    void reserve(const std::vector<Patch>& patches);
    void setUp(int triangle, const Plate& plate, const MirroredMesh& mesh, const Patch& patch, const RestShape& rest);
    void setUpMirrored(Element& e, const MirroredMesh& mesh, const Patch& patch, const SecondDerivatives& rows);
    void assembleConstant(int vertexCount);
    void keepMirroredOnly(const RestShape& rest);
    Vectors derivatives(const Element& e, const Points& x) const;
    Vectors residual(const Element& e, const Points& x) const;
    double valueOf(const Element& e, const Points& x) const;
    double valueIn(const Points& x, double* memory) const;
    double flatValue(const Points& x, double* memory) const;
    void addElementGradient(const Element& e, const Points& x, const auto& add) const;
    void addNormalGradient(const Element& e, const TriangleNormal& normal, const Points& x, const auto& add) const;
    void addMirrored(const Element& e, StepSystem& system, const Points& x) const;
    void addNormalTerms(const Element& e, StepSystem& system, const Points& x, HessianKind kind) const;
    const double* padded(const Points& x) const;

    std::vector<Element> m_elements;  ///< of all triangles, or of mirrored patches alone
    std::vector<int> m_vertices;
    std::vector<Vec3> m_rows;  ///< B: weights of a vertex for uu, vv, uv [1/m^2]
    std::vector<int> m_slots;  ///< of pairs (vertex, corner), or of all pairs of a mirrored patch
    std::vector<Mirrored> m_mirrored;
    ConstantHessian m_constant;
    /// Of shells that are flat for good, else empty: rest positions about their centre, and the inverse of the sum of
    /// their squares. An affine map of them stores nothing.
    Points m_flatRest;
    Mat3 m_inverseMoments;
    const BlockMatrix* m_matrix = nullptr;  ///< for its memory for positions in fours
};

}  // namespace jacket
