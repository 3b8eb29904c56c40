#pragma once
#include <LinearMath/btVector3.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <random>

#include "jacket/Types.h"

namespace jacket::bullet::testing {

/// What chance draws from a seed, the same on every machine: for tests over many sizes, poses and worlds.
class Random {
  public:
    explicit Random(unsigned series) : m_engine(series) {}
    double between(double low, double high) { return low + (high - low) * (m_engine() / 4294967296.0); }
    double logBetween(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
    double scale() { return logBetween(1e-3, 1e3); }  // 1 mm .. 1 km
    int below(int count) { return static_cast<int>(between(0, count)); }
    template <class T, std::size_t N>
    const T& of(const T (&choices)[N]) {
        return choices[below(int(N))];
    }
    Vec3 inBox(const Vec3& low, const Vec3& high) {  // one after the other, as arguments would not be
        Vec3 drawn;
        for (int k = 0; k < 3; ++k) drawn[k] = between(low[k], high[k]);
        return drawn;
    }
    Vec3 inCube(double half) { return inBox(Vec3::Constant(-half), Vec3::Constant(half)); }
    btVector3 vector(const Vec3& low, const Vec3& high) {
        const Vec3 drawn = inBox(low, high);
        return {btScalar(drawn.x()), btScalar(drawn.y()), btScalar(drawn.z())};
    }
    Vec3 direction() {
        for (;;) {  // of the points of a ball: those of a cube lie more along its diagonals
            const Vec3 point = inCube(1.0);
            if (const double length = point.norm(); length > 0.1 && length < 1.0) return point / length;
        }
    }
    Eigen::Isometry3d frame(double offset) {
        Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
        const double angle = between(0, 3);
        frame.linear() = Eigen::AngleAxisd(angle, direction()).toRotationMatrix();
        frame.translation() = inCube(offset);
        return frame;
    }

  private:
    std::mt19937 m_engine;
};

}  // namespace jacket::bullet::testing
