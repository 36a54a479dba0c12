// SPDX-FileCopyrightText: 2026 rigid_gns maintainers
// SPDX-License-Identifier: Apache-2.0

// Rapier for `rapier_engine.py`: the first line of the input is a scene, each further one asks for
// a frame, which is answered with the centres, as doubles.

'use strict'

const { writeSync } = require('node:fs')
const { createInterface } = require('node:readline')

const xyz = ([x, y, z]) => ({ x, y, z })

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
  return { world, bodies, substeps: scene.substeps, places: new Float64Array(3 * bodies.length) }
}

const answer = (array) => {
  const bytes = new Uint8Array(array.buffer)
  for (let done = 0; done < bytes.length; ) done += writeSync(1, bytes, done)
}

const advance = ({ world, bodies, substeps, places }) => {
  for (let k = 0; k < substeps; k += 1) world.step()
  bodies.forEach((body, i) => {
    const { x, y, z } = body.translation()
    places.set([x, y, z], 3 * i)
  })
  answer(places)
}

const main = async (name) => {
  const RAPIER = require(require.resolve(name, { paths: [process.cwd()] }))
  await RAPIER.init()
  answer(new Float64Array(1)) // it is loaded
  let run = null
  for await (const line of createInterface({ input: process.stdin })) {
    if (run === null) {
      run = begin(RAPIER, JSON.parse(line))
      answer(new Float64Array(1))
    } else {
      advance(run)
    }
  }
}

main(process.argv[2])
