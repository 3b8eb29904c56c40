#include "SoftSheet.h"

#include <algorithm>
#include <set>

#include "Convert.h"
#include "jacket/HalfEdgeMesh.h"

namespace jacket::demo {

namespace {

/// Links between nodes that are two links apart: what btSoftBody::generateBendingConstraints(2) makes, in its order,
/// but without its table of all pairs of nodes, which takes 400 MB for 10 000 nodes.
void addBendingLinks(btSoftBody& body) {
    const int count = body.m_nodes.size();
    std::vector<std::vector<int>> neighbours(count);
    for (int l = 0; l < body.m_links.size(); ++l) {
        const int a = static_cast<int>(body.m_links[l].m_n[0] - &body.m_nodes[0]);
        const int b = static_cast<int>(body.m_links[l].m_n[1] - &body.m_nodes[0]);
        neighbours[a].push_back(b);
        neighbours[b].push_back(a);
    }
    for (int i = 0; i < count; ++i) {
        std::set<int> apart;
        for (const int near : neighbours[i])
            for (const int far : neighbours[near])
                if (far < i) apart.insert(far);
        for (const int near : neighbours[i]) apart.erase(near);
        for (const int far : apart) {
            body.appendLink(far, i);
            body.m_links[body.m_links.size() - 1].m_bbending = -1;  // a bit with a sign: set
        }
    }
}

}  // namespace

std::vector<std::array<int, 2>> gridLinks(const TriangleMesh& mesh, int columns) {
    std::vector<std::array<int, 2>> links;
    const HalfEdgeMesh edges(mesh.triangles, static_cast<int>(mesh.positions.cols()));
    for (const auto& edge : edges.edges()) {
        const int a = std::min(edge.v0, edge.v1), b = std::max(edge.v0, edge.v1);
        if (b == a + 1 || b == a + columns) links.push_back({a, b});
    }
    std::sort(links.begin(), links.end());
    return links;
}

std::vector<double> lumpedMasses(const TriangleMesh& mesh, double areaDensity) {
    std::vector<double> masses(mesh.positions.cols(), 0.0);
    for (const auto& t : mesh.triangles.colwise()) {
        const Vec3 a = mesh.positions.col(t[0]), b = mesh.positions.col(t[1]), c = mesh.positions.col(t[2]);
        const double area = 0.5 * (b - a).cross(c - a).norm();
        for (int k = 0; k < 3; ++k) masses[t[k]] += areaDensity * area / 3.0;
    }
    return masses;
}

std::unique_ptr<btSoftBody> makeSoftBody(btSoftBodyWorldInfo& info, const SoftSheet& sheet) {
    std::vector<btVector3> x;
    for (const auto& p : sheet.mesh.positions.colwise()) x.push_back(toBullet(Vec3(p)));
    auto body = std::make_unique<btSoftBody>(&info, static_cast<int>(x.size()), x.data(), nullptr);
    for (const auto& [a, b] : sheet.links) body->appendLink(a, b);
    for (const auto& t : sheet.mesh.triangles.colwise()) body->appendFace(t[0], t[1], t[2]);
    for (std::size_t i = 0; i < sheet.masses.size(); ++i) body->setMass(static_cast<int>(i), btScalar(sheet.masses[i]));
    body->m_materials[0]->m_kLST = 1;
    body->m_cfg.piterations = sheet.iterations;
    body->m_cfg.kDF = btScalar(std::min(sheet.friction, 1.0));
    addBendingLinks(*body);
    body->getCollisionShape()->setMargin(btScalar(sheet.margin));
    return body;
}

}  // namespace jacket::demo
