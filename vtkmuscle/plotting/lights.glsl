// The five lights of vtkLightKit: direction (right, up, towards the eye), and colour.
vec3 lit = vec3(0.0);
lit += max(dot(normalVCVSOutput, vec3(0.0, 0.0, 1.0)), 0.0) * vec3(0.25, 0.25, 0.25);
lit += max(dot(normalVCVSOutput, vec3(0.111619, 0.766044, 0.633022)), 0.0) * vec3(0.75, 0.72924, 0.676665);
lit += max(dot(normalVCVSOutput, vec3(-0.044943, -0.965926, 0.254887)), 0.0) * vec3(0.22706, 0.233285, 0.25);
lit += max(dot(normalVCVSOutput, vec3(0.939693, 0.0, -0.34202)), 0.0) * vec3(0.214286, 0.214286, 0.214286);
lit += max(dot(normalVCVSOutput, vec3(-0.939693, 0.0, -0.34202)), 0.0) * vec3(0.214286, 0.214286, 0.214286);
gl_FragData[0] = vec4(ambientColor + lit * diffuseColor, opacity);
