// SPDX-FileCopyrightText: 2026 rigid_gns maintainers
// SPDX-License-Identifier: Apache-2.0

// Rapier for `rapier_engine.py`.

'use strict'

const { serve } = require('./node_engine.js')

const xyz = ([x, y, z]) => ({ x, y, z })

const load = async (name) => {
  const RAPIER = require(require.resolve(name, { paths: [process.cwd()] }))
  await RAPIER.init()
  return RAPIER
}

const begin = (RAPIER, scene) => {
  const world = new RAPIER.World(xyz(scene.gravity))
  world.timestep = scene.step
  world.numSolverIterations = scene.iterations
  const product = RAPIER.CoefficientCombineRule.Multiply
  const material = (shape, { restitution, friction }) =>
    shape
      .setRestitution(restitution)
      .setRestitutionCombineRule(product)
      .setFriction(friction)
      .setFrictionCombineRule(product)
  for (const plane of scene.planes) {
    const shape = new RAPIER.ColliderDesc(new RAPIER.HalfSpace(xyz(plane.normal)))
    world.createCollider(material(shape.setTranslation(...plane.point), plane))
  }
  const bodies = scene.positions.map((place, i) => {
    const [x, y, z, w] = scene.quaternions[i]
    const desc = RAPIER.RigidBodyDesc.dynamic()
      .setTranslation(...place)
      .setRotation({ x, y, z, w })
      .setLinvel(...scene.velocities[i])
      .setAngvel(xyz(scene.angular_velocities[i]))
    const body = world.createRigidBody(desc)
    const ball = RAPIER.ColliderDesc.ball(scene.radius).setMass(scene.mass)
    world.createCollider(material(ball, scene), body)
    return body
  })
  return (places) => {
    for (let k = 0; k < scene.substeps; k += 1) world.step()
    bodies.forEach((body, i) => {
      const { x, y, z } = body.translation()
      places.set([x, y, z], 3 * i)
    })
  }
}

serve(load, begin)
