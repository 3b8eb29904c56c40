#pragma once
#include <cmath>
#include <random>

#include "Convert.h"

namespace jacket::bullet::testing {

/// What chance draws from a seed, for tests over many sizes and poses.
class Random {
  public:
    explicit Random(unsigned seed) : m_engine(seed) {}
    double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(m_engine); }
    double scale() { return std::pow(10.0, between(-3, 3)); }  // 1 mm .. 1 km
    Vec3 inCube(double half) { return {between(-half, half), between(-half, half), between(-half, half)}; }
    Vec3 direction() {
        std::normal_distribution<double> normal;
        return Vec3(normal(m_engine), normal(m_engine), normal(m_engine)).normalized();
    }
    Frame frame(double offset) {
        Frame frame = Frame::Identity();
        frame.linear() = Eigen::AngleAxisd(between(0, 3), direction()).toRotationMatrix();
        frame.translation() = inCube(offset);
        return frame;
    }

  private:
    std::mt19937 m_engine;
};

}  // namespace jacket::bullet::testing
